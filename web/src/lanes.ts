// A lane for each machine, with a bar for each command, over the last minute of the cell's time; it ends at now.
//
// A bar is drawn once, and again when its command ends. What moves is the strip that all of them stand on, by one
// transform that the compositor carries out; a bar of which the command is under way goes on beyond now, out of sight.
// What stands on a bar of which the beginning has gone out of sight is put where it is seen whole, now and then.
// Of many machines only the lanes that are in view have bars.

import { h, svg } from "./dom";

export interface Bar {
  number: number;
  machine: string;
  command: string;
  from: number;
  to: number | null;
  end: "working" | "done" | "left" | "instant";
}

const SHOWN_SECONDS = 60;
/** So much time goes by before all is drawn anew, with numbers that are small again. */
const DRAWN_SECONDS = 90;
const HEIGHT = 26;
const LETTER_WIDTH = 6.4;
const LABEL_SECONDS = 1;

/** What stands on a bar: where, and where the bar ends. */
interface Label {
  text: SVGTextElement;
  x: number;
  end: number;
}

interface Lane {
  top: number;
  words: HTMLElement;
  last: number;
}

export class Lanes {
  readonly element: HTMLElement;
  private readonly strip = svg("svg", { class: "strip", "aria-hidden": "true" });
  private readonly window: HTMLElement;
  private readonly lanes = new Map<string, Lane>();
  private readonly bars = new Map<number, { bar: Bar; group: SVGGElement }>();
  private readonly labels = new Map<number, Label>();
  private looked = 0;
  private origin = 0;
  private now = 0;
  private scale = 0;
  private view: [number, number] = [0, 0];

  constructor(machines: string[]) {
    const names = h("ul", { class: "lane-names", "aria-label": "What each machine does" });
    for (const [i, machine] of machines.entries()) {
      const words = h("span", { class: "unseen" }, "rests");
      this.lanes.set(machine, { top: i * HEIGHT, words, last: -1 });
      names.append(h("li", {}, h("b", { class: "machine", title: machine }, machine), " ", words));
    }
    this.window = h("div", { class: "lane-window", "aria-hidden": "true" });
    const axis = h("div", { class: "axis", "aria-hidden": "true" });
    for (let ago = 0; ago <= SHOWN_SECONDS; ago += 10) {
      const right = `right: ${(100 * ago) / SHOWN_SECONDS}%`;
      this.window.append(h("i", { class: "tick", style: right }));
      axis.append(h("span", { style: ago === SHOWN_SECONDS ? "left: 0" : right }, ago === 0 ? "now" : `−${ago} s`));
    }
    this.window.append(this.strip);
    this.element = h("div", { class: "lanes", tabindex: "0", role: "group", "aria-label": "Lanes of the machines; scrolls" }, names, this.window, axis);
    this.element.style.setProperty("--names", `${Math.min(16, Math.max(...machines.map((name) => name.length)) + 1)}ch`);
    this.element.addEventListener("scroll", () => this.look());
    new ResizeObserver(() => this.look()).observe(this.window);
    new ResizeObserver(() => this.look()).observe(this.element);
  }

  /** Another part of the lanes is in view, or they are wider or narrower. */
  private look(): void {
    const { scrollTop, clientHeight } = this.element;
    this.view = [scrollTop - HEIGHT, scrollTop + clientHeight];
    this.scale = this.window.clientWidth / SHOWN_SECONDS;
    this.drawAll();
  }

  /** Bars that are new or other than they were. */
  take(bars: Bar[]): void {
    for (const bar of bars) {
      const lane = this.lanes.get(bar.machine);
      if (lane === undefined) continue;
      this.bars.get(bar.number)?.group.remove();
      const group = svg("g");
      this.bars.set(bar.number, { bar, group });
      this.draw(bar, group, lane);
      if (bar.number < lane.last) continue;
      lane.last = bar.number;
      lane.words.textContent = bar.end === "working" ? `is at ${bar.command}` : "rests";
    }
  }

  /** Time goes on. */
  at(now: number): void {
    this.now = now;
    if (now < this.origin || now - this.origin > DRAWN_SECONDS) this.drawAll();
    if (Math.abs(now - this.looked) >= LABEL_SECONDS / 2) this.keepLabels();
    if (this.scale > 0) this.strip.style.transform = `translateX(${((this.origin - now) * this.scale).toFixed(1)}px)`;
  }

  /** Put labels that are about to leave on the left where they are seen whole, as long as there is room for them. */
  private keepLabels(): void {
    this.looked = this.now;
    const edge = (this.now - this.origin - SHOWN_SECONDS) * this.scale;
    for (const [number, label] of this.labels) {
      if (label.x >= edge + 5 + (LABEL_SECONDS / 2) * this.scale) continue;
      label.x = edge + 5 + LABEL_SECONDS * this.scale;
      label.text.setAttribute("x", String(label.x));
      if (label.x + label.text.textContent.length * LETTER_WIDTH + 3 <= label.end) continue;
      label.text.remove();
      this.labels.delete(number);
    }
  }

  private drawAll(): void {
    this.origin = this.now;
    this.strip.replaceChildren();
    this.labels.clear();
    for (const [number, { bar, group }] of this.bars) {
      if (bar.to !== null && bar.to < this.now - SHOWN_SECONDS) this.bars.delete(number);
      else this.draw(bar, group, this.lanes.get(bar.machine)!);
    }
    this.keepLabels();
    this.at(this.now);
  }

  private draw(bar: Bar, group: SVGGElement, { top }: Lane): void {
    if (this.scale === 0 || top < this.view[0] || top > this.view[1]) return;
    const from = Math.max(bar.from, this.origin - SHOWN_SECONDS);
    const x = (from - this.origin) * this.scale;
    const width = Math.max(3, (bar.to === null ? 2 * DRAWN_SECONDS + SHOWN_SECONDS : bar.to - from) * this.scale);
    const title = svg("title");
    title.textContent = `${bar.command}: ${bar.to === null ? "working" : `${(bar.to - bar.from).toFixed(1)} s`}`;
    group.replaceChildren(title, svg("rect", { x, y: top + 3, width, height: HEIGHT - 7, rx: 4, class: `bar ${bar.end}` }));
    const words = bar.command.slice(bar.machine.length + 1);
    this.labels.delete(bar.number);
    if (width > words.length * LETTER_WIDTH + 8) {
      const text = svg("text", { x: x + 5, y: top + 17, class: "command" });
      text.textContent = words;
      group.append(text);
      this.labels.set(bar.number, { text, x: x + 5, end: x + width });
    }
    this.strip.append(group);
  }
}
