// Playing a run that is known, a counterexample most of all: a slider over its frames, steps on and back, and a clock.

import { announce, calm, counted, h } from "./dom";
import type { Picture } from "./picture";
import { Refused, type At, type Moment, type Run } from "./server";
import type { Scene } from "./top_view";

const FRAME_MS = 900;

/** Who waits for whom in a deadlock. */
export function circle(moment: Moment): HTMLElement[] {
  const told = moment.circle ?? [];
  return told.length > 0 ? [h("li", { class: "circle" }, "In a circle, each waiting for the next:", h("ul", { class: "list" }, ...told.map((one) => h("li", {}, one))))] : [];
}

export class Playback {
  readonly element: HTMLElement;
  private readonly slider: HTMLInputElement;
  private readonly words = h("p", { class: "what" });
  private readonly stuck = h("ul", { class: "list", hidden: true });
  private readonly playButton: HTMLButtonElement;
  private at = 0;
  private asked = 0;
  private timer: ReturnType<typeof setInterval> | undefined;
  private moment: Moment | null = null;

  constructor(
    private readonly run: Run,
    private readonly picture: Picture,
    private readonly moments: (at: At) => Promise<Moment>,
    private readonly end: (here: Moment | null) => void,
    /** Draw the controllers that the run passes through; none where there is nothing but the whole net. */
    open: (() => void) | null,
  ) {
    const last = run.frames.length - 1;
    this.slider = h("input", {
      type: "range", min: 0, max: last, value: 0, step: 1, "aria-label": `Steps of ${run.name}`,
      input: () => this.show(Number(this.slider.value)),
    });
    this.playButton = h("button", { type: "button", click: () => this.toggle() }, "▶ Play");
    const button = (words: string, label: string, click: () => void): HTMLButtonElement =>
      h("button", { type: "button", "aria-label": label, title: label, click }, words);
    this.element = h("section", { class: "playback", "aria-label": `The run ${run.name}` },
      h("div", { class: "playhead" }, h("b", {}, run.name), h("span", { class: "soft" }, run.says)),
      h("div", { class: "controls" },
        button("|◀", "To the beginning", () => this.show(0)),
        button("←", "One step back", () => this.show(this.at - 1)),
        this.playButton,
        button("→", "One step on", () => this.show(this.at + 1)),
        button("▶|", "To the end", () => this.show(last)),
        this.slider,
        open && h("button", { type: "button", title: "Draw the controllers that this run passes through", click: open }, "Open its controllers"),
        h("button", { type: "button", click: () => this.close(true) }, "Go on from here"),
        h("button", { type: "button", click: () => this.close(false) }, "Close"),
      ),
      this.words,
      this.stuck,
      run.left_out > 0 ? h("p", { class: "soft" }, `${counted(run.left_out, "more event")} of this run are not shown.`) : null,
    );
  }

  begin(): void {
    this.picture.passes(new Set(this.run.frames.flatMap((frame) => frame.fired ?? [])));
    this.show(0);
    this.slider.focus();
  }

  private toggle(): void {
    if (this.timer !== undefined) return this.pause();
    if (this.at >= this.run.frames.length - 1) this.show(0);
    this.playButton.textContent = "⏸ Pause";
    this.timer = setInterval(() => {
      this.show(this.at + 1);
      if (this.at >= this.run.frames.length - 1) this.pause();
    }, FRAME_MS);
  }

  private pause(): void {
    clearInterval(this.timer);
    this.timer = undefined;
    this.playButton.textContent = "▶ Play";
  }

  private show(index: number): void {
    const { frames } = this.run;
    const to = Math.min(frames.length - 1, Math.max(0, index));
    const frame = frames[to]!;
    if (frame.fired) this.picture.reveal(frame.fired);
    if (to === this.at + 1 && frame.fired && !calm()) this.picture.fly(frame.fired);
    this.at = to;
    this.slider.value = String(to);
    const time = frame.at == null ? "" : ` at ${frame.at.toFixed(1)} s`;
    const last = to === frames.length - 1;
    const turn = frame.turn ? " From here on it goes round for ever." : "";
    const note = last && this.run.note ? ` ${this.run.note}` : "";
    const said = `${to} of ${frames.length - 1}${time}: ${frame.what}${frame.says ? `, ${frame.says}` : ""}.${turn}${note}`;
    this.slider.setAttribute("aria-valuetext", said);
    this.words.replaceChildren(h("b", {}, `${to} / ${frames.length - 1}`), ` ${frame.what}`, frame.says ? h("span", { class: "soft" }, ` ${frame.says}`) : "", time ? h("span", { class: "soft" }, time) : "", turn, note ? h("strong", {}, `${note}.`) : "");
    this.stuck.hidden = true;
    if (document.activeElement !== this.slider) announce(said);
    const at: At = { marking: frame.marking, signals: frame.signals, free: this.run.free, scene: this.scene(to) };
    this.picture.show({ ...at, transitions: {} });
    void this.tell(at);
  }

  /** How the cell looks in a frame: as the last frame before it that tells. */
  private scene(index: number): Scene | undefined {
    for (let i = index; i >= 0; i--) if (this.run.frames[i]!.scene !== undefined) return this.run.frames[i]!.scene;
    return undefined;
  }

  /** What may fire in the frame that is shown: asked for the newest only. */
  private async tell(at: At): Promise<void> {
    const mine = ++this.asked;
    try {
      const moment = await this.moments(at);
      if (mine !== this.asked) return;
      this.moment = moment;
      this.picture.show(moment);
      if (this.at === this.run.frames.length - 1 && moment.deadlock) {
        const stuck = Object.values(moment.transitions).filter((wait) => wait.near).map((wait) => wait.why ?? "");
        this.stuck.replaceChildren(h("li", { class: "stuck" }, "A deadlock: nothing can fire any more."), ...circle(moment), ...stuck.map((why) => h("li", {}, why)));
        this.stuck.hidden = false;
      }
    } catch (error) {
      if (mine === this.asked) this.words.append(` ${error instanceof Refused ? error.message : "The connection is lost."}`);
    }
  }

  /** Another run takes its place. */
  stop(): void {
    this.pause();
    this.picture.passes(null);
    this.asked++;
  }

  private close(goOn: boolean): void {
    this.stop();
    this.end(goOn ? this.moment : null);
  }
}
