// Playing with a net. The page holds where it is and where it was; what may fire, and what comes of it, it asks.

import { announce, counted, h, isTyping } from "./dom";
import { banner, frame, panel, watchFile, type Frame } from "./frame";
import { Drawing } from "./drawing";
import type { Picture } from "./picture";
import { circle, Playback } from "./playback";
import { ask, Refused, type At, type Draft, type Edited, type EditState, type Fired, type Moment, type PlayPage, type Run, type RunSummary, type Verdict, type Written } from "./server";
import { TopView } from "./top_view";

interface Step {
  what: string;
  moment: Moment;
}

/** What leads away from playing with this net. */
interface Leaving {
  edit: (state: EditState) => void;
  reload: () => void;
  /** The file has been written: its net is played now. */
  cured: (edited: Written, words: string) => void;
  /** What was to be written is no net. */
  mend: (state: EditState, draft: Draft) => void;
}

const KEPT = "firable-at";
const STEPS_SHOWN = 200;

/** Words of which those between backticks are what stands in a net file. */
const inCode = (words: string): (Node | string)[] => words.split("`").map((part, i) => (i % 2 === 1 ? h("code", {}, part) : part));

export class Play {
  private readonly drawing: Drawing;
  /** The first picture, without which nothing is played: which controllers can be opened comes with it. */
  private readonly begun: Promise<boolean>;
  private readonly picture: Picture;
  private readonly top: TopView;
  private readonly frame: Frame;
  private steps: Step[];
  private undone: Step[] = [];
  private queue: Promise<void> = Promise.resolve();
  private explained: string | null = null;
  private readonly undoButton = this.button("Undo", "Undo (Ctrl+Z)", () => this.undo());
  private readonly redoButton = this.button("Redo", "Redo (Ctrl+Shift+Z)", () => this.redo());
  private readonly resetButton = this.button("Reset", "Back to the initial marking", () => this.reset());
  private readonly gatesSwitch = h("button", { type: "button", role: "switch", class: "switch", click: () => this.setFree(!this.now.free) }, "Gates free");
  private readonly mayFire = h("ul", { class: "list" });
  private readonly mayWait = h("ul", { class: "list" });
  private readonly mayNot = h("ul", { class: "list" });
  private readonly waitPanel = panel("Ready, but a gate is closed", this.mayWait);
  private readonly notPanel = panel("Not now", this.mayNot);
  private readonly switches = h("div", { class: "switches" });
  private readonly log = h("ol", { class: "log" });
  private readonly checks = h("div", { class: "checks" });
  private readonly words = new Map<string, string>();
  private playback: Playback | null = null;

  constructor(
    private readonly page: PlayPage,
    private readonly to: Leaving,
  ) {
    for (const { name, says } of page.net.transitions) this.words.set(name, says);
    const drawing = this.drawing = new Drawing(page.net, {
      transition: (name) => void this.fire(name),
      signal: (name) => void this.toggle(name),
      pointed: (name) => this.picture.mark(name ?? this.explained),
    });
    this.picture = drawing.picture;
    this.top = new TopView(page.top);
    this.frame = frame(page.net.name || "the net", page.net.description, "Playing", drawing, this.top);
    this.begun = drawing.draw(page.net, null);
    this.steps = [{ what: "the initial marking", moment: "scene" in page.top ? { ...page.moment, top: page.top } : page.moment }];
    const editButton = this.button("Edit", "Edit the net file", () => void this.beginEdit());
    this.frame.tools.append(this.undoButton, this.redoButton, this.resetButton, this.gatesSwitch, editButton);
    if (page.editable) watchFile(this.frame, () => page.shown, () => true, this.to.reload);
    this.gatesSwitch.title = "Free: external gates are open, as the analysis has them. Else they are as the signals say.";
    this.frame.side.append(
      h("div", { class: "own" }, panel("May fire", this.mayFire), this.waitPanel),
      panel("Checks", this.checks),
      h("div", { class: "own" }, ...(page.net.signals.length > 0 ? [panel("Signals", this.switches)] : []), panel("Steps", this.log), this.notPanel),
    );
    this.makeSwitches();
    this.showChecks(page.verdicts, page.runs);
    addEventListener("keydown", (event) => this.key(event), { signal: this.frame.gone });
    this.frame.gone.addEventListener("abort", () => this.playback?.stop());
    const kept = sessionStorage.getItem(KEPT);
    this.show();
    void this.goOn(kept ?? "{}");
  }

  private beginEdit(): Promise<void> {
    return this.doing(async () => {
      const state = await ask<EditState>("api/edit");
      if (state.why_not === undefined) return this.to.edit(state);
      this.frame.hint.textContent = `Not to be edited: ${state.why_not}.`;
      announce(this.frame.hint.textContent);
    });
  }

  private get now(): Moment {
    return this.steps[this.steps.length - 1]!.moment;
  }

  private button(words: string, title: string, click: () => void): HTMLButtonElement {
    return h("button", { type: "button", title, click }, words);
  }

  /** After a reload of this window go on where one was. */
  private async goOn(kept: string): Promise<void> {
    try {
      const { net, ...at } = JSON.parse(kept) as Moment & { net?: string };
      if (net !== this.page.net.name) return;
      const moment = await ask<Moment>("api/moment", at);
      if (moment.marking.join() === this.now.marking.join() && moment.signals.length === 0 && !moment.free) return;
      this.add("as before the reload", moment);
    } catch (error) {
      // The net is another one now: it is played from its beginning.
      sessionStorage.removeItem(KEPT);
      if (!(error instanceof Refused)) throw error;
    }
  }

  private at(moment: Moment): At {
    return { marking: moment.marking, signals: moment.signals, free: moment.free, scene: moment.top?.scene };
  }

  private add(what: string, moment: Moment): void {
    this.steps.push({ what, moment });
    this.undone = [];
    this.show();
  }

  /** Do something after all that was asked for before it. */
  private doing(work: () => Promise<void>, whilePlaying = false): Promise<void> {
    this.queue = this.queue.then(() => this.done(work, whilePlaying));
    return this.queue;
  }

  private async done(work: () => Promise<void>, whilePlaying: boolean): Promise<void> {
    if (this.playback !== null && !whilePlaying) return;
    this.explained = null;
    this.picture.mark(null);
    this.frame.hint.textContent = "";
    this.frame.banner.replaceChildren();
    try {
      await work();
    } catch (error) {
      const lost = !(error instanceof Refused);
      const words = lost ? "The connection is lost: is `firable view` still running?" : error.message;
      banner(this.frame.banner, "bad", words);
    }
  }

  private fire(name: string): Promise<void> {
    return this.doing(async () => {
      const wait = this.now.transitions[name];
      if (wait?.may !== "fire") {
        this.explain(name, wait?.why ?? "");
        return;
      }
      const after = await ask<Fired>("api/fire", { ...this.at(this.now), shown: this.page.shown, transition: name });
      this.picture.reveal([name]);
      this.picture.fly([name]);
      const says = this.words.get(name);
      this.add(`${name} fires${says ? `: ${says}` : ""}`, after);
      const sent = after.sent.length > 0 ? ` Sent: ${after.sent.join(", ")}.` : "";
      announce(`${name} has fired.${sent} ${this.summary(after)}`);
    });
  }

  private toggle(signal: string): Promise<void> {
    return this.doing(async () => {
      const on = !this.now.signals.includes(signal);
      const signals = on ? [...this.now.signals, signal] : this.now.signals.filter((name) => name !== signal);
      const after = await ask<Moment>("api/moment", { ...this.at(this.now), shown: this.page.shown, signals, became: on ? signal : null });
      this.add(`${signal} becomes ${on ? 1 : 0}`, after);
      announce(`${signal} is ${on ? 1 : 0}. ${this.summary(after)}`);
    });
  }

  private setFree(free: boolean): Promise<void> {
    return this.doing(async () => {
      this.add(free ? "gates are free" : "gates as the signals say", await ask<Moment>("api/moment", { ...this.at(this.now), shown: this.page.shown, free }));
      announce(`${free ? "Gates are free." : "Gates are as the signals say."} ${this.summary(this.now)}`);
    });
  }

  private summary(moment: Moment): string {
    if (moment.deadlock) return "A deadlock: no transition can fire any more.";
    const may = Object.values(moment.transitions).filter((wait) => wait.may === "fire").length;
    return may > 0 ? `${counted(may, "transition")} may fire.` : "Nothing may fire; some transition waits for its gate.";
  }

  private undo(): void {
    if (this.steps.length < 2 || this.playback !== null) return;
    this.undone.push(this.steps.pop()!);
    this.show();
    announce(`Undone. ${this.summary(this.now)}`);
  }

  private redo(): void {
    const step = this.undone.pop();
    if (step === undefined || this.playback !== null) return;
    this.steps.push(step);
    this.show();
    announce(`Done again: ${step.what}. ${this.summary(this.now)}`);
  }

  private reset(): void {
    if (this.steps.length < 2 || this.playback !== null) return;
    const first = this.steps[0]!;
    this.undone = this.steps.slice(1).reverse();
    this.steps = [first];
    this.show();
    announce(`The initial marking. ${this.summary(this.now)}`);
  }

  private backTo(step: number): void {
    while (this.steps.length > step + 1) this.undone.push(this.steps.pop()!);
    this.show();
  }

  private key(event: KeyboardEvent): void {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
    if (isTyping(event.target)) return;
    event.preventDefault();
    if (event.shiftKey) this.redo();
    else this.undo();
  }

  /** Say why a transition may not fire, until something else is done. */
  private explain(name: string, why: string): void {
    announce(why);
    this.explained = name;
    this.picture.mark(name);
    this.frame.hint.textContent = why;
  }

  // What is shown

  private makeSwitches(): void {
    const { signals, controllers } = this.page.net;
    for (const owner of [...controllers, null]) {
      const own = signals.filter((signal) => signal.owner === owner);
      if (own.length === 0) continue;
      const group = h("div", { role: "group", "aria-label": owner ?? "signals" }, owner ? h("h3", {}, owner) : null);
      for (const signal of own) {
        const short = owner && signal.name.startsWith(`${owner}.`) ? signal.name.slice(owner.length + 1) : signal.name;
        const made = h("button", {
          type: "button", role: "switch", class: "switch", "data-signal": signal.name, "aria-label": signal.name,
          title: `${signal.kind}; gates ${signal.gates.join(", ") || "nothing"}`, click: () => void this.toggle(signal.name),
        }, short);
        group.append(made);
      }
      this.switches.append(group);
    }
  }

  private show(): void {
    const moment = this.now;
    this.picture.show(moment);
    if (moment.top) this.top.show(moment.top);
    sessionStorage.setItem(KEPT, JSON.stringify({ net: this.page.net.name, ...this.at(moment) }));
    this.undoButton.disabled = this.steps.length < 2;
    this.redoButton.disabled = this.undone.length === 0;
    this.resetButton.disabled = this.steps.length < 2;
    this.gatesSwitch.setAttribute("aria-checked", String(moment.free));
    for (const one of this.switches.querySelectorAll<HTMLElement>("[data-signal]")) {
      one.setAttribute("aria-checked", String(moment.signals.includes(one.dataset.signal!)));
      one.toggleAttribute("data-moot", moment.free);
    }
    this.frame.status.className = `status ${moment.deadlock ? "bad" : ""}`;
    this.frame.status.textContent = this.summary(moment);
    this.showTransitions(moment);
    const from = Math.max(0, this.steps.length - STEPS_SHOWN);
    this.log.start = from;
    this.log.replaceChildren(
      ...this.steps.slice(from).map((step, i) =>
        h("li", { "aria-current": from + i === this.steps.length - 1 ? "step" : null },
          h("button", { type: "button", class: "plain", title: "Go back to here", click: () => this.backTo(from + i) }, step.what)),
      ),
    );
    this.log.scrollTop = this.log.scrollHeight;
  }

  private showTransitions(moment: Moment): void {
    const active = document.activeElement instanceof HTMLElement ? document.activeElement : null;
    const focused = active?.dataset.transition ?? active?.dataset.opens;
    const may: HTMLElement[] = [];
    const waiting: HTMLElement[] = [];
    const not: HTMLElement[] = [];
    for (const { name, says } of this.page.net.transitions) {
      const wait = moment.transitions[name]!;
      const over = { pointerenter: () => this.picture.mark(name), pointerleave: () => this.picture.mark(this.explained) };
      if (wait.may === "fire")
        may.push(h("li", {}, h("button", { type: "button", class: "go", "data-transition": name, click: () => void this.fire(name) }, h("b", {}, name), says ? h("span", {}, says) : null)));
      else if (wait.may === "not") not.push(h("li", { class: "not", ...over }, wait.why ?? ""));
      else waiting.push(h("li", { class: "wait", ...over }, h("span", {}, wait.why ?? ""), ...(wait.closed ?? []).map((signal) => this.opener(signal))));
    }
    if (may.length === 0) may.push(h("li", { class: "none" }, moment.deadlock ? "Nothing ever again: this is a deadlock." : "Nothing: open a gate."), ...circle(moment));
    this.mayFire.replaceChildren(...may);
    this.mayWait.replaceChildren(...waiting);
    this.mayNot.replaceChildren(...not);
    this.waitPanel.hidden = waiting.length === 0;
    this.notPanel.hidden = not.length === 0;
    // Who fires by the keyboard stays among what may fire.
    if (focused !== undefined) {
      const again = [...this.mayFire.querySelectorAll<HTMLElement>("button"), ...this.mayWait.querySelectorAll<HTMLElement>("button")];
      (again.find((one) => one.dataset.transition === focused) ?? again[0])?.focus();
    }
  }

  /** A button that opens a gate which somebody waits for. */
  private opener(signal: string): HTMLElement {
    const to = this.now.signals.includes(signal) ? 0 : 1;
    return h("button", { type: "button", class: "small", "data-opens": signal, click: () => void this.toggle(signal) }, `${signal} = ${to}`);
  }

  // Checks and counterexamples

  private showChecks(verdicts: Verdict[] | null, runs: RunSummary[]): void {
    const check = h("button", { type: "button", class: "wide", click: () => void this.check(check) }, "Check this net");
    const played = (name: string): HTMLElement =>
      h("button", { type: "button", class: "go small", click: () => void this.playRun(name) }, h("b", {}, "▶ Play"), h("span", { class: "unseen" }, ` ${name}`));
    const known = new Set(runs.map((run) => run.name));
    const rows = (verdicts ?? []).filter((one) => one.listed);
    const order = ["bad", "open", "good"];
    const rank = (one: Verdict): number => order.indexOf(one.tone ?? "open");
    const hint = (one: Verdict["hints"][number]): HTMLElement => h("span", { class: "soft" }, h("code", {}, one.code), " ", ...inCode(one.says));
    const mine = new Set(rows.map((one) => one.name));
    this.checks.replaceChildren(
      verdicts === null ? check : "",
      h("ul", { class: "list verdicts" },
        ...runs.filter((run) => !mine.has(run.name)).map((run) => h("li", {}, h("div", {}, h("b", {}, run.name), h("span", {}, `${run.says}, ${counted(run.firings, "firing")}`)), played(run.name))),
        ...rows.sort((a, b) => rank(a) - rank(b)).map((one) =>
          h("li", { class: one.tone ?? "" },
            h("div", {}, h("b", {}, h("i", { "aria-hidden": "true" }, one.sign), ` ${one.name}`), h("span", {}, `${one.word}: ${one.says}`), one.about ? h("span", {}, `about: ${one.about}`) : null, ...one.hints.map(hint)),
            known.has(one.name) ? played(one.name) : null, this.cures(one))),
      ),
    );
  }

  /** What to write so that a verdict holds; each was checked before it is offered. */
  private cures(verdict: Verdict): HTMLElement | null {
    if (verdict.cures.length === 0) return null;
    const write = (words: string, number: number): HTMLElement =>
      h("button", { type: "button", class: "small", "aria-label": `Write into the file: ${words}`, click: () => void this.cure(verdict.name, number, words) }, "Write into the file");
    return h("details", { class: "cures" }, h("summary", {}, `${counted(verdict.cures.length, "cure")} of ${verdict.name}`), h("ul", { class: "list" }, ...verdict.cures.map((cure, i) => {
      const words = cure.changes.join("; and ");
      return h("li", {}, ...inCode(words), h("span", { class: "soft" }, `checked: ${cure.checked}`), this.page.editable ? write(words, i) : null);
    })));
  }

  /** Write a cure into the net file, and play with the net that it makes. */
  private cure(verdict: string, number: number, words: string): Promise<void> {
    return this.writing("api/edit", { do: "cure", verdict, number }, `Written into the file: ${words}.`);
  }

  private writing(path: string, body: object, words: string): Promise<void> {
    if (this.playback !== null) {
      this.playback.stop();
      this.ended(null);
    }
    return this.doing(async () => {
      const state = await ask<EditState>("api/edit");
      const edited = await ask<Edited>(path, { ...body, version: state.version });
      if ("page" in edited) this.to.cured(edited, words);
      else this.to.mend(state, edited);
    });
  }

  /** Say what was written, and how it is taken back. */
  written(state: EditState, words: string): void {
    const undo = h("button", { type: "button", click: () => void this.writing("api/edit/undo", {}, `Undone: ${state.undo}.`) }, "Undo");
    banner(this.frame.banner, "good", words, ...(state.undo !== null ? [undo] : []));
    announce(words);
  }

  private check(button: HTMLButtonElement): Promise<void> {
    button.disabled = true;
    button.textContent = "Checking…";
    return this.doing(async () => {
      try {
        const { verdicts, runs } = await ask<{ verdicts: Verdict[]; runs: RunSummary[] }>("api/check", {});
        this.showChecks(verdicts, runs);
        const failing = verdicts.filter((one) => one.fails).length;
        announce(failing > 0 ? `Of what must hold, ${failing} do${failing === 1 ? "es" : ""} not.` : "Nothing that must hold is violated.");
      } finally {
        button.disabled = false;
        button.textContent = "Check this net";
      }
    });
  }

  private async playRun(name: string): Promise<void> {
    await this.doing(async () => {
      const [run] = await Promise.all([ask<Run>("api/run", { name }), this.begun]);
      this.playback?.stop();
      this.playback = new Playback(run, this.picture, async (at) => {
        const moment = await ask<Moment>("api/moment", { ...at, shown: this.page.shown });
        if (moment.top) this.top.show(moment.top);
        return moment;
      }, (here) => this.ended(here), this.drawing.owners.length > 0 ? () => void this.openOf(run) : null);
      this.frame.below.replaceChildren(this.playback.element);
      this.frame.side.classList.add("playing");
      this.frame.status.className = "status";
      this.frame.status.textContent = `Playing ${name}`;
      for (const button of this.frame.tools.querySelectorAll("button")) button.disabled = true;
      this.playback.begin();
    }, true);
  }

  /** Draw the controllers that take part in what a run fires. */
  private openOf(run: Run): Promise<void> {
    const fired = new Set(run.frames.flatMap((frame) => frame.fired ?? []));
    const taking = new Set(this.page.net.transitions.filter(({ name }) => fired.has(name)).flatMap(({ owners }) => owners));
    return this.drawing.open(this.drawing.owners.filter((owner) => taking.has(owner)));
  }

  private ended(here: Moment | null): void {
    this.playback = null;
    this.frame.below.replaceChildren();
    this.frame.side.classList.remove("playing");
    for (const button of this.frame.tools.querySelectorAll("button")) button.disabled = false; // show() knows of the others
    if (here !== null) this.add("where the run was left", here);
    else this.show();
    this.mayFire.querySelector<HTMLElement>("button")?.focus();
  }
}
