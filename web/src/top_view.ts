// The cell from above: belts, tables, arms and workpieces, where the server says that they stand and what they do. What
// moves is moved by transitions of the style sheet, as long as its command takes; who wants no motion sees it arrive.

import { calm, h, svg } from "./dom";

type Spot = [number, number];
type Way = [number, number, number, number];

export interface Scene {
  pieces: [number, string, boolean][];
  hands: Record<string, string>;
  busy: Record<string, string>;
  arrived: number;
}

export interface Top {
  scene: Scene;
  doing: Record<string, { does: string; command: string; from: string; to: string; takes_s: number }>;
  words: string[];
}

interface Arm {
  base: Spot;
  home: Spot;
  positions: Record<string, Spot>;
  gripper: string[];
}

interface View {
  name: string;
  says: string;
  stations: Record<string, Spot>;
  /** Of each the ways on which it carries, from one station, by the stations to which they lead. */
  belts: Record<string, Record<string, Way>>;
  tables: Record<string, Spot>;
  arms: Record<string, Arm>;
  others: Record<string, Spot>;
  arrivals: string;
  departures: string[];
}

export type TopStart = { why_not: string } | (Top & { view: View });

const PLAYED_S = 0.7;
const MARGIN = 95;
const WIDTH = 44;
/** So many letters of a name have room beside their neighbours: of a machine, of a belt, of a station, and inside an arm. */
const NAME_LONGEST = 12;
const BELT_LONGEST = 23;
const SPOT_LONGEST = 17;
const INSIDE_LONGEST = 5;

/** Names that differ at their ends only are told apart, so what is left out is the middle. */
function shortened(words: string, longest: number): string {
  const all = [...words];
  if (all.length <= longest) return words;
  const tail = Math.floor((longest - 1) / 2);
  return `${all.slice(0, longest - 1 - tail).join("")}…${all.slice(-tail).join("")}`;
}

function polar([x, y]: Spot, at: Spot): { turn: number; length: number } {
  return { turn: (Math.atan2(at[1] - y, at[0] - x) * 180) / Math.PI, length: Math.hypot(at[0] - x, at[1] - y) };
}

/** The middle of a belt, which is that of the first of its ways: it stands on the line. */
function middle(ways: Record<string, Way>): Spot {
  const [x1, y1, x2, y2] = Object.values(ways)[0]!;
  return [(x1 + x2) / 2, (y1 + y2) / 2];
}

export class TopView {
  readonly element = h("div", { class: "topview", id: "top", role: "tabpanel", "aria-labelledby": "tab-top", tabindex: "0", hidden: true });
  private readonly drawing = svg("svg", { role: "img" });
  private readonly words = h("ul", { class: "list scene-words" });
  private readonly pieces = new Map<number, SVGGElement>();
  private readonly hands = new Map<string, { arm: SVGGElement; reach: SVGRectElement; hand: SVGGElement }>();
  private readonly machines = new Map<string, SVGGElement>();
  private readonly layer = svg("g");
  private readonly view: View | null;

  constructor(start: TopStart) {
    if ("why_not" in start) {
      this.view = null;
      this.element.append(h("p", { class: "none" }, `There is no top view: ${start.why_not}.`));
      return;
    }
    this.view = start.view;
    this.drawing.setAttribute("aria-label", `${start.view.name} from above`);
    this.draw(start.view);
    this.element.append(this.drawing, this.words);
    this.show(start, 0);
  }

  get isThere(): boolean {
    return this.view !== null;
  }

  private group(name: string, kind: string): SVGGElement {
    const made = svg("g", { class: `machine ${kind}`, "data-machine": name });
    this.machines.set(name, made);
    this.drawing.append(made);
    return made;
  }

  private label(x: number, y: number, words: string, kind = "name", longest = NAME_LONGEST): SVGTextElement {
    const made = svg("text", { x, y, class: kind, "text-anchor": "middle" });
    made.textContent = shortened(words, kind === "name" ? longest : SPOT_LONGEST);
    if (made.textContent === words) return made;
    const title = svg("title");
    title.textContent = words;
    made.append(title);
    return made;
  }

  private draw(view: View): void {
    const spots = [...Object.values(view.stations), ...Object.values(view.others), ...Object.values(view.arms).flatMap((arm) => [arm.base, arm.home])];
    const xs = spots.map(([x]) => x);
    const ys = spots.map(([, y]) => y);
    const [left, top] = [Math.min(...xs) - MARGIN, Math.min(...ys) - MARGIN];
    this.drawing.setAttribute("viewBox", `${left} ${top} ${Math.max(...xs) + MARGIN - left} ${Math.max(...ys) + MARGIN - top}`);
    for (const [name, ways] of Object.entries(view.belts)) {
      const belt = this.group(name, "belt");
      const [bodies, running] = [svg("g"), svg("g")]; // so that no body lies on another's way
      for (const [to, [x1, y1, x2, y2]] of Object.entries(ways).reverse()) { // that on the line above those that branch off
        const length = Math.hypot(x2 - x1, y2 - y1) + WIDTH + 12;
        const transform = `translate(${(x1 + x2) / 2} ${(y1 + y2) / 2}) rotate(${(Math.atan2(y2 - y1, x2 - x1) * 180) / Math.PI})`;
        bodies.append(svg("rect", { x: -length / 2, y: -WIDTH / 2 - 5, width: length, height: WIDTH + 10, rx: 8, class: "body", transform }));
        running.append(svg("path", { d: `M${-length / 2 + 6} 0H${length / 2 - 6}`, class: "running", "data-to": to, transform }));
      }
      const [x, y] = middle(ways);
      belt.append(bodies, running, this.label(x, y + WIDTH / 2 + 22, name, "name", BELT_LONGEST), this.label(x, y + WIDTH / 2 + 37, "", "doing"));
    }
    for (const [name, [x, y]] of Object.entries(view.tables)) {
      const table = this.group(name, "table");
      table.append(svg("rect", { x: x - 46, y: y - 46, width: 92, height: 92, rx: 10, class: "body" }), this.label(x, y - 70, name), this.label(x, y - 54, "", "doing"));
    }
    for (const [name, [x, y]] of Object.entries(view.others)) {
      const other = this.group(name, "other");
      const half = Math.max(40, 4.7 * Math.min(name.length, NAME_LONGEST) + 2);
      other.append(svg("rect", { x: x - half, y: y - 26, width: 2 * half, height: 52, rx: 8, class: "body" }), this.label(x, y + 5, name), this.label(x, y + 44, "", "doing"));
    }
    for (const [name, [x, y]] of Object.entries(view.stations)) {
      const station = svg("g", { class: "station" });
      const title = svg("title");
      title.textContent = `${name}${name === view.arrivals ? ", where workpieces come" : view.departures.includes(name) ? ", where they leave" : ""}`;
      const isOnTable = Object.values(view.tables).some(([a, b]) => a === x && b === y); // whose own name is above
      station.append(title, svg("rect", { x: x - WIDTH / 2, y: y - WIDTH / 2, width: WIDTH, height: WIDTH, rx: 5 }), this.label(x, y + (isOnTable ? WIDTH / 2 + 16 : -WIDTH / 2 - 10), name, "spot"));
      if (name === view.arrivals) station.append(svg("path", { d: `M${x - 58} ${y}h22m-8 -7l8 7l-8 7`, class: "way" }));
      if (view.departures.includes(name)) station.append(svg("path", { d: `M${x + 36} ${y}h22m-8 -7l8 7l-8 7`, class: "way" }));
      this.drawing.append(station);
    }
    this.drawing.append(this.layer);
    for (const [name, { base }] of Object.entries(view.arms)) this.arm(name, base);
  }

  private arm(name: string, [x, y]: Spot): void {
    const group = this.group(name, "arm");
    const arm = svg("g", { class: "moving" });
    const reach = svg("rect", { x: 0, y: -7, width: 1, height: 14, class: "link moving" });
    const hand = svg("g", { class: "hand moving" });
    hand.append(svg("path", { d: "M-15 -13h30M-15 13h30M-15 -13v26" }));
    arm.append(reach, hand);
    const side = y > 0 ? 1 : -1;
    const label = this.label(x, y + 5, name);
    if ([...name].length > INSIDE_LONGEST) {
      label.setAttribute("x", String(x + 32));
      label.setAttribute("text-anchor", "start");
    }
    group.append(arm, svg("circle", { cx: x, cy: y, r: 24, class: "body" }), label, this.label(x, y + side * 62 + (side > 0 ? 8 : 0), "", "doing")); // beyond a hand at home
    this.hands.set(name, { arm, reach, hand });
  }

  /** Show a scene; what is on its way takes so many seconds, as the commands say where none are given. */
  show(top: Top, seconds = PLAYED_S, speed = 0): void {
    const { view } = this;
    if (view === null) return;
    const lasting = (machine: string): number => (calm() ? 0 : speed > 0 ? (top.doing[machine]?.takes_s ?? 0.2) / speed : seconds);
    for (const [name, group] of this.machines) {
      const doing = top.doing[name];
      group.classList.toggle("busy", doing !== undefined);
      for (const way of group.querySelectorAll<SVGPathElement>(".running")) way.classList.toggle("on", way.dataset["to"] === doing?.to);
      group.querySelector(".doing")!.textContent = doing === undefined ? "" : shortened(doing.command.slice(name.length + 1), SPOT_LONGEST);
    }
    for (const name of this.hands.keys()) this.reach(view.arms[name]!, name, this.handAt(view, top, name), lasting(name));
    const there = new Set<number>();
    for (const [number, on, machined] of top.scene.pieces) {
      there.add(number);
      const at = this.spot(view, top, on);
      const mover = this.hands.has(on) || on in view.belts ? on : Object.keys(top.doing).find((name) => top.doing[name]!.to === on || top.doing[name]!.from === on);
      const holder = this.holder(view, on) ?? "";
      const piece = this.pieces.get(number) ?? this.piece(number, holder, at);
      piece.classList.toggle("machined", machined);
      if (piece.dataset["holder"] !== holder) this.hold(piece, holder);
      piece.style.transitionDuration = `${mover === undefined ? Math.min(seconds, 0.2) : lasting(mover)}s`;
      piece.style.transform = this.held(view, holder, at);
    }
    for (const [number, piece] of this.pieces) {
      if (there.has(number)) continue;
      piece.remove();
      this.pieces.delete(number);
    }
    const key = top.words.join("\n");
    if (this.words.dataset["key"] !== key) {
      this.words.dataset["key"] = key;
      this.words.replaceChildren(...top.words.map((one) => h("li", {}, one)));
    }
  }

  private piece(number: number, holder: string, at: Spot): SVGGElement {
    const made = svg("g", { class: "piece moving", "data-holder": holder });
    made.append(svg("rect", { x: -13, y: -13, width: 26, height: 26, rx: 4 }), svg("circle", { r: 6 }));
    made.style.transform = this.held(this.view!, holder, at);
    this.layer.append(made);
    this.pieces.set(number, made);
    return made;
  }

  /** A workpiece goes into a hand, or out of it: from where it is, without a move. */
  private hold(piece: SVGGElement, holder: string): void {
    const { e, f } = new DOMMatrix(getComputedStyle(piece).transform);
    piece.dataset["holder"] = holder;
    piece.style.transitionDuration = "0s";
    piece.style.transform = this.held(this.view!, holder, [e, f]);
    piece.getBoundingClientRect(); // the browser has moved it there before the next move begins
  }

  /** Where a workpiece is, told as the hand that holds it is (`reach`), so that both turn on their way alike. */
  private held(view: View, holder: string, at: Spot): string {
    const [x, y] = view.arms[holder]?.base ?? at;
    const { turn, length } = polar([x, y], at);
    return `translate(${x}px, ${y}px) rotate(${turn}deg) translate(${length}px, 0px) rotate(${-turn}deg)`;
  }

  private holder(view: View, on: string): string | undefined {
    return Object.keys(view.arms).find((name) => name === on || view.arms[name]!.gripper.includes(on));
  }

  private handAt(view: View, top: Top, name: string): Spot {
    const arm = view.arms[name]!;
    const doing = top.doing[name];
    if (doing?.does === "carry") return view.stations[arm.gripper.includes(doing.to) ? doing.from : doing.to] ?? arm.home;
    const position = doing?.does === "move" ? doing.to : (top.scene.hands[name] ?? "");
    return arm.positions[position] ?? arm.home;
  }

  /** Where a workpiece is drawn: on its station, in a hand, or on a belt, at the end to which it is carried. */
  private spot(view: View, top: Top, on: string): Spot {
    const arm = this.holder(view, on);
    if (arm !== undefined) return this.handAt(view, top, arm);
    const ways = view.belts[on];
    if (ways === undefined) return view.stations[on] ?? [0, 0];
    return view.stations[top.doing[on]?.to ?? ""] ?? middle(ways);
  }

  private reach({ base }: Arm, name: string, at: Spot, seconds: number): void {
    const { arm, reach, hand } = this.hands.get(name)!;
    const { turn, length } = polar(base, at);
    for (const one of [arm, reach, hand]) one.style.transitionDuration = `${seconds}s`;
    arm.style.transform = `translate(${base[0]}px, ${base[1]}px) rotate(${turn}deg)`;
    reach.style.transform = `scaleX(${Math.max(1, length - 16)})`;
    hand.style.transform = `translate(${length}px, 0px)`;
  }
}
