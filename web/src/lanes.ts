// A lane for each machine, with a bar for each command, over the last minute of the cell's time; it ends at now.

import { h, svg } from "./dom";

export interface Bar {
  place: string;
  command: string;
  from: number;
  to: number | null;
  end: "working" | "done" | "left" | "instant";
}

export interface Lane {
  machine: string;
  bars: Bar[];
}

const SHOWN_SECONDS = 60;
const HEIGHT = 26;
const NAME_WIDTH = 74;
const AXIS = 18;

export class Lanes {
  readonly element = h("div", { class: "lanes" });
  private readonly lanes = new Map<string, Lane>();
  private readonly drawing = svg("svg", { role: "img", "aria-label": "What each machine did in the last minute" });
  private readonly said = h("ul", { class: "unseen" });
  private key = "";

  constructor() {
    this.element.append(this.drawing, this.said);
  }

  take(lanes: Lane[]): void {
    for (const lane of lanes) this.lanes.set(lane.machine, lane);
  }

  draw(now: number): void {
    const width = Math.max(300, this.element.clientWidth);
    const key = `${width}/${(now * (width / SHOWN_SECONDS)).toFixed(0)}/${[...this.lanes.values()].map((lane) => `${lane.bars.length},${lane.bars.at(-1)?.to}`).join()}`;
    if (key === this.key) return;
    this.key = key;
    const span = width - NAME_WIDTH - 8;
    const x = (at: number): number => NAME_WIDTH + span * (1 - (now - at) / SHOWN_SECONDS);
    const height = this.lanes.size * HEIGHT + AXIS;
    this.drawing.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.drawing.setAttribute("height", String(height));
    const parts: Node[] = [];
    for (let ago = 0; ago <= SHOWN_SECONDS; ago += 10) {
      const at = x(now - ago);
      parts.push(svg("line", { x1: at, x2: at, y1: 0, y2: height - AXIS, class: "tick" }));
      const label = svg("text", { x: at, y: height - 4, "text-anchor": ago === 0 ? "end" : "middle", class: "when" });
      label.textContent = ago === 0 ? "now" : `−${ago} s`;
      parts.push(label);
    }
    const told: string[] = [];
    let y = 0;
    for (const { machine, bars } of this.lanes.values()) {
      const name = svg("text", { x: 4, y: y + 17, class: "machine" });
      name.textContent = machine;
      parts.push(name);
      for (const bar of bars) {
        const from = Math.max(NAME_WIDTH, x(bar.from));
        const to = x(bar.to ?? now);
        if (to < NAME_WIDTH) continue;
        const shape = svg("rect", { x: from, y: y + 3, width: Math.max(3, to - from), height: HEIGHT - 7, rx: 4, class: `bar ${bar.end}` });
        const title = svg("title");
        title.textContent = `${bar.command}: ${bar.end === "working" ? "working" : `${((bar.to ?? now) - bar.from).toFixed(1)} s`}`;
        shape.append(title);
        parts.push(shape);
        const words = bar.command.slice(machine.length + 1);
        if (to - from > words.length * 6.4 + 8) {
          const label = svg("text", { x: from + 5, y: y + 17, class: "command" });
          label.textContent = words;
          parts.push(label);
        }
      }
      const last = bars.at(-1);
      told.push(last?.end === "working" ? `${machine} is at ${last.command}` : `${machine} rests`);
      y += HEIGHT;
    }
    this.drawing.replaceChildren(...parts);
    const told_ = told.join("\n");
    if (this.said.textContent !== told.join("")) this.said.replaceChildren(...told_.split("\n").map((one) => h("li", {}, one)));
  }
}
