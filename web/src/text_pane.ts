// The text of the file: the truth, to read and to edit by hand. What the reader refuses is marked at its line, in words
// below, and a click leads to it. Nothing is coloured by grammar here: that would be a reader of its own.

import { announce, counted, h } from "./dom";
import type { Problem } from "./server";

const TRY_MS = 350;

export class TextPane {
  readonly element: HTMLDetailsElement;
  private readonly area = h("textarea", {
    class: "text", spellcheck: "false", autocapitalize: "off", autocomplete: "off", wrap: "off", "aria-label": "Text of the net file",
    "aria-describedby": "problems", input: () => this.typed(), scroll: () => this.scrolled(), keydown: (event: KeyboardEvent) => this.key(event),
  });
  private readonly gutter = h("div", { class: "gutter", "aria-hidden": "true" });
  private readonly problems = h("ul", { class: "list problems", id: "problems" });
  private readonly saveButton = h("button", { type: "button", title: "Ctrl+S", click: () => this.save() }, "Save the text");
  private readonly dropButton = h("button", { type: "button", click: () => this.drop() }, "Discard");
  private readonly state = h("span", { class: "soft" });
  private saved: string;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    text: string,
    private readonly on: { save: (text: string) => void; try_: (text: string) => Promise<Problem[]>; changed: () => void },
  ) {
    this.area.value = text;
    this.saved = this.area.value; // with the line ends of a text area, whatever those of the file are
    this.element = h("details", { class: "text-pane", open: innerHeight > 700 },
      h("summary", {}, h("h2", {}, "Text of the file"), " ", this.state),
      h("div", { class: "editor" }, this.gutter, this.area),
      this.problems,
      h("div", { class: "tools" }, this.saveButton, this.dropButton),
    );
    this.show([]);
  }

  /** Whether something is typed that is not written. */
  get dirty(): boolean {
    return this.area.value !== this.saved;
  }

  /** Whether nothing can be typed, for an edit is on its way whose text takes the place of the one here. */
  hold(held: boolean): void {
    this.area.readOnly = held;
  }

  /** The file has another text now; its first line that is new is shown. What was typed since `sent` is kept. */
  take(text: string, sent: string | null): void {
    const before = this.saved.split("\n");
    const typed = this.area.value;
    this.area.value = text;
    this.saved = this.area.value;
    if (sent !== null && typed !== sent) {
      this.area.value = typed;
      this.show([]);
      return;
    }
    const after = this.saved.split("\n");
    const at = after.findIndex((line, i) => line !== before[i]);
    this.show([]);
    if (at < 0) return;
    this.gutter.children[at]?.classList.add("new");
    this.area.scrollTop = Math.max(0, at - 3) * this.lineHeight();
  }

  /** A text that is no net, to be mended here: not written, or that of the file. What was typed since `sent` is kept. */
  refuse(problems: Problem[], draft: string, sent: string | null, isFile: boolean): void {
    if (sent === null || this.area.value === sent) this.area.value = draft;
    if (isFile) this.saved = this.area.value;
    this.element.open = true;
    this.show(problems);
    const first = problems.find((one) => one.line !== null);
    if (first) this.goTo(first);
  }

  private drop(): void {
    this.area.value = this.saved;
    this.show([]);
    announce("What was typed is discarded.");
    this.on.changed();
  }

  private save(): void {
    if (this.dirty) this.on.save(this.area.value);
  }

  private key(event: KeyboardEvent): void {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "s") return;
    event.preventDefault();
    this.save();
  }

  private typed(): void {
    this.show([]);
    this.on.changed();
    clearTimeout(this.timer);
    const text = this.area.value;
    this.timer = setTimeout(() => {
      this.on.try_(text).then((found) => {
        if (this.area.value === text) this.show(found);
      }, () => undefined); // that nobody answers is told when it is saved
    }, TRY_MS);
  }

  private show(problems: Problem[]): void {
    const bad = new Set(problems.map((one) => one.line));
    const lines = this.area.value.split("\n");
    this.gutter.replaceChildren(...lines.map((_, i) => h("span", { class: bad.has(i + 1) ? "bad" : "" }, String(i + 1))));
    this.problems.replaceChildren(
      ...problems.map((one) =>
        h("li", { class: "wait problem" },
          h("button", { type: "button", class: "small", "aria-label": `Go to line ${one.line}`, click: () => this.goTo(one) }, `${one.line ?? 1}:${one.column ?? 1}`),
          h("span", {}, `${one.message} `, h("code", {}, one.code)), one.hint ? h("span", { class: "soft" }, one.hint) : null)),
    );
    this.area.setAttribute("aria-invalid", String(problems.length > 0));
    this.saveButton.disabled = this.dropButton.disabled = !this.dirty;
    this.state.textContent = problems.length > 0 ? `no net: ${counted(problems.length, "problem")}${this.dirty ? ", not written" : ""}` : this.dirty ? "not written yet" : "";
    this.scrolled();
  }

  private goTo(one: Problem): void {
    const lines = this.area.value.split("\n");
    const line = Math.min(one.line ?? 1, lines.length);
    const begin = lines.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0);
    const characters = [...(lines[line - 1] ?? "")]; // columns count these, and a text area counts halves of some
    const units = (end: number): number => characters.slice(0, end).join("").length;
    const column = (one.column ?? 1) - 1;
    this.area.focus();
    this.area.setSelectionRange(begin + units(column), begin + units(column + Math.max(1, one.length ?? 1)));
    this.area.scrollTop = Math.max(0, line - 4) * this.lineHeight();
  }

  private lineHeight(): number {
    return parseFloat(getComputedStyle(this.area).lineHeight);
  }

  private scrolled(): void {
    this.gutter.scrollTop = this.area.scrollTop;
  }
}
