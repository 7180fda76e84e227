// Editing the net. What is done here is asked of the server, which does it to the text of the file and reads that again;
// the page shows what came of it: the net, or why there is none, at the line where it is.

import { announce, h, isTyping } from "./dom";
import { Drawing } from "./drawing";
import { Details, type Chosen, type Doing } from "./edit_details";
import { banner, frame, panel, watchFile, type Frame } from "./frame";
import { ask, Refused, type Draft, type Edited, type EditState, type PlayPage, type Problem } from "./server";
import { TextPane } from "./text_pane";

type Tool = "choose" | "arc" | "if" | "unless";
const TOOLS: [Tool, string, string][] = [
  ["choose", "Choose", "Choose what is edited"],
  ["arc", "Arc", "From a place to a transition, or from a transition to a place"],
  ["if", "Gate if", "A permissive gate: a transition and a place, or a signal"],
  ["unless", "Gate unless", "An inhibitive gate: a transition and a place, or a signal"],
];

export class Edit {
  private readonly drawing: Drawing;
  private readonly frame: Frame;
  private readonly pane: TextPane;
  private readonly details: Details;
  private readonly undoButton = h("button", { type: "button", click: () => void this.step("undo") }, "Undo");
  private readonly redoButton = h("button", { type: "button", click: () => void this.step("redo") }, "Redo");
  private readonly toolButtons = new Map<Tool, HTMLButtonElement>();
  private tool: Tool = "choose";
  private first: Chosen | null = null;
  private queue: Promise<void> = Promise.resolve();
  private asking = false;

  constructor(private page: PlayPage, private state: EditState, done: () => void) {
    this.drawing = new Drawing(page.net, {
      place: (name) => this.pick({ kind: "place", name }),
      transition: (name) => this.pick({ kind: "transition", name }),
      signal: (name) => this.pick({ kind: "signal", name }),
    });
    this.frame = frame(page.net.name || "the net", page.file, "Editing", this.drawing);
    void this.drawing.draw(page.net, []);
    this.frame.status.textContent = "Editing: each edit is written to the file";
    const leave = (): void => {
      if (this.pane.dirty && !confirm("What is typed in the text is not written. Leave it?")) return;
      done();
    };
    const tools = h("div", { class: "tools", role: "group", "aria-label": "What a click does" });
    for (const [tool, words, title] of TOOLS) {
      const made = h("button", { type: "button", title, "aria-pressed": String(tool === "choose"), click: () => this.take(tool) }, words);
      this.toolButtons.set(tool, made);
      tools.append(made);
    }
    this.frame.tools.append(h("button", { type: "button", title: "Play with the net", click: leave }, "← Play"), this.undoButton, this.redoButton, tools);
    this.details = new Details((what) => void this.does(what), (chosen) => this.choose(chosen));
    this.frame.side.append(panel("Chosen", this.details.chosenPanel), panel("Add", this.details.addPanel));
    this.pane = new TextPane(state.text, {
      save: (text) => void this.ask("api/edit/text", { text }, undefined, text),
      try_: async (text) => (await ask<{ errors: Problem[] }>("api/edit/try", { text })).errors,
      changed: () => this.frame.banner.replaceChildren(),
    });
    this.frame.below.append(this.pane.element);
    addEventListener("keydown", (event) => this.key(event), { signal: this.frame.gone });
    addEventListener("beforeunload", (event) => this.pane.dirty && event.preventDefault(), { signal: this.frame.gone });
    watchFile(this.frame, () => this.shown, () => this.state.is_net, () => this.reload());
    this.show();
  }

  /** A text that is no net: it is shown with what is wrong, and not written; where it is the file itself, it is said so. */
  refuse({ errors: problems, draft, version }: Draft, sent: string | null = null): void {
    const words = problems.length === 1 ? problems[0]!.message : `${problems[0]?.message ?? ""}, and ${problems.length - 1} more`;
    const isFile = version !== null;
    if (isFile) this.state = { ...this.state, version, is_net: false };
    banner(this.frame.banner, "bad", isFile ? `The file is no net: ${words}. Mend it in the text below.` : `This is no net, and nothing is written: ${words}. Mend it in the text below, or discard it.`);
    this.pane.refuse(problems, draft, sent, isFile);
  }

  /** The net that is shown; while an edit is on its way none, for the server may have another already. */
  private get shown(): number {
    return this.asking ? NaN : this.page.shown;
  }

  private does(what: Doing): Promise<void> {
    return this.ask("api/edit", what, what.then, null, what.done);
  }

  private step(which: "undo" | "redo"): Promise<void> {
    return this.ask(`api/edit/${which}`, {});
  }

  private reload(): void {
    if (this.pane.dirty && !confirm("What is typed in the text is not written. Load the file in its place?")) return;
    void this.ask("api/edit/reload", {});
  }

  /** Ask for an edit, after all that was asked for before it; `sent` is the text that was typed, if that is one. */
  private ask(path: string, body: object, then?: Chosen, sent: string | null = null, done?: () => void): Promise<void> {
    this.queue = this.queue.then(async () => {
      const { undo, redo } = this.state;
      if ((path === "api/edit/undo" && undo === null) || (path === "api/edit/redo" && redo === null)) return; // by the keyboard, or a second click
      if (path !== "api/edit/text" && path !== "api/edit/reload" && this.pane.dirty) {
        banner(this.frame.banner, "open", "The text below is not written: save it or discard it first.");
        return;
      }
      this.frame.banner.replaceChildren();
      this.asking = true;
      this.pane.hold(sent === null);
      try {
        const answer = await ask<Edited>(path, { version: this.state.version, ...body, then: undefined });
        if ("page" in answer) {
          this.takeOver(answer, then, sent);
          done?.();
        } else this.refuse(answer, sent);
      } catch (error) {
        this.fail(error, path === "api/edit/reload" ? `${this.page.file}: ` : "");
      } finally {
        this.asking = false;
        this.pane.hold(false);
      }
    });
    return this.queue;
  }

  /** `of` names the file that could not be read. */
  private fail(error: unknown, of: string): void {
    if (!(error instanceof Refused)) {
      banner(this.frame.banner, "bad", "The connection is lost: is `firable view` still running?");
      return;
    }
    const again = h("button", { type: "button", class: "reload", click: () => this.reload() }, "Load it again");
    const stale = error.problems.some((one) => one.code === "F1019");
    const words = error.problems.map((one) => `${one.message}${one.hint ? ` (${one.hint})` : ""}`).join("; ") || error.message;
    banner(this.frame.banner, "bad", `${of}${words}.`, ...(stale ? [again] : []));
    this.show();
  }

  private takeOver({ page, edit }: { page: PlayPage; edit: EditState }, then: Chosen | undefined, sent: string | null): void {
    const before = this.state;
    this.page = page;
    this.state = edit;
    void this.drawing.draw(page.net, []);
    this.pane.take(edit.text, sent);
    const last = edit.redo !== null && edit.redo === before.undo ? `Undone: ${edit.redo}` : `Done: ${edit.undo ?? "loaded again"}`;
    this.frame.status.textContent = `${last}.`;
    announce(`${last}.`);
    if (then !== undefined) this.details.chosen = then;
    this.show();
  }

  private show(): void {
    const { page, state } = this;
    this.undoButton.disabled = state.undo === null;
    this.redoButton.disabled = state.redo === null;
    this.undoButton.title = state.undo === null ? "Undo (Ctrl+Z)" : `Undo (Ctrl+Z): ${state.undo}`;
    this.redoButton.title = state.redo === null ? "Redo (Ctrl+Shift+Z)" : `Redo (Ctrl+Shift+Z): ${state.redo}`;
    const transitions = Object.fromEntries(page.net.transitions.map(({ name }) => [name, { may: "not" as const }]));
    this.drawing.picture.show({ marking: state.marked, signals: [], transitions });
    this.details.show(page.net, state);
    const { kind = "", name = "" } = this.details.chosen ?? {};
    this.drawing.picture.choose(kind, name);
    this.drawing.bringIn(kind, name);
  }

  private choose(chosen: Chosen | null): void {
    this.details.chosen = chosen;
    this.first = null;
    this.show();
    if (chosen !== null) announce(`${chosen.kind} ${chosen.name} is chosen.`);
  }

  // Arcs and gates by two clicks

  private take(tool: Tool): void {
    this.tool = tool;
    this.first = null;
    for (const [one, button] of this.toolButtons) button.setAttribute("aria-pressed", String(one === tool));
    this.frame.hint.textContent = tool === "choose" ? "" : tool === "arc" ? "Choose where the arc begins: a place or a transition." : "Choose the transition, and then the place or signal of its gate, or the other way round.";
    announce(this.frame.hint.textContent);
  }

  private pick(chosen: Chosen): void {
    const { first, tool } = this;
    if (tool === "choose") return this.choose(chosen);
    this.drawing.picture.choose(chosen.kind, chosen.name);
    const isPair = first !== null && (first.kind === "transition") !== (chosen.kind === "transition");
    if (!isPair) {
      this.first = chosen;
      this.frame.hint.textContent = `From ${chosen.name}: now choose ${chosen.kind === "transition" ? "a place" : "a transition"}. Esc ends this.`;
      announce(this.frame.hint.textContent);
      return;
    }
    const transition = (first.kind === "transition" ? first : chosen).name;
    const name = (first.kind === "transition" ? chosen : first).name;
    const part = tool === "arc" ? (first.kind === "transition" ? "to" : "from") : tool;
    this.take(tool);
    void this.does({ do: "connect", transition, part, name, then: { kind: "transition", name: transition } });
  }

  private key(event: KeyboardEvent): void {
    if (event.key === "Escape" && this.tool !== "choose") return this.take("choose");
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
    if (isTyping(event.target)) return;
    event.preventDefault();
    void this.step(event.shiftKey ? "redo" : "undo");
  }
}
