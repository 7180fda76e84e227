// The picture of the net: the SVG that `firable draw` makes, in which tokens come and go. Its parts are found by the ids
// that the drawing gives them. It stands in a shadow tree, because its style sheet speaks of `text` and `.name` as if it
// were alone. What is drawn here is only what changes: tokens, who may fire, open gates, and tokens on their way.
//
// It may be there before it is drawn, and be drawn anew with tasks folded: what is to be shown is kept, and shown then.

import { h, svg } from "./dom";
import { Flights, type Arc } from "./flights";
import pictureStyle from "./picture.css?inline";
import type { Drawn, Net, Wait } from "./server";

export interface Shown {
  marking: Iterable<string>;
  signals: Iterable<string>;
  transitions: Record<string, Wait>;
}

export interface Pressed {
  place?: (name: string) => void;
  transition?: (name: string) => void;
  signal?: (name: string) => void;
  pointed?: (name: string | null) => void;
  /** A task that is drawn as one place. */
  task?: (name: string) => void;
}

interface Gate {
  signal: string;
  wanted: boolean;
  group: SVGGElement;
}

interface Spot {
  group: SVGGElement;
  token: SVGCircleElement;
  label: string;
}

/** So much of the top is left out: the title of the drawing stands in the head of the page. */
const TITLE_HEIGHT = 56;
/** Who moves the pointer by so many pixels between press and release drags the picture. */
const DRAGGED = 5;
const KINDS_OF_ARC = new Map([["input", false], ["output", true]]);

export class Picture {
  readonly element = h("div", { class: "picture" });
  /** What is said over the picture while there is none, or another one is to come. */
  private readonly note = h("div", { class: "drawing-note", role: "status" });
  private readonly root = this.element.attachShadow({ mode: "open" });
  private readonly style = document.createElement("style");
  private drawing: SVGSVGElement | null = null;
  private readonly spots = new Map<string, Spot>();
  private readonly bars = new Map<string, SVGGElement[]>();
  private readonly arcs = new Map<string, Arc[]>();
  private readonly gates = new Map<string, Gate[]>();
  private readonly flights = new Flights();
  /** The place that stands for a place inside a folded task. */
  private readonly within = new Map<string, string>();
  private width = 0;
  private height = 0;
  private scale = 1;
  private held = new Set<string>();
  private on = new Set<string>();
  private marking: Iterable<string> = [];
  private signals: Iterable<string> = [];
  private readonly waits = new Map<string, Wait>();
  private readonly marked = new Set<Element>();
  private chosen: [string, string] | null = null;

  constructor(
    private net: Net,
    private readonly pressing: Pressed,
  ) {
    this.style.textContent = pictureStyle;
    this.root.append(document.createElement("slot"), this.style);
    this.element.append(this.note);
    this.pan();
    if (pressing.place) this.rove();
  }

  say(...words: (Node | string)[]): void {
    this.note.replaceChildren(...words);
  }

  /** Show a drawing; one that takes the place of another is as large, and stands where that one stood. */
  draw(net: Net, drawn: Drawn): void {
    this.net = net;
    const isFirst = this.drawing === null;
    const hadFocus = this.root.activeElement !== null;
    for (const map of [this.spots, this.bars, this.arcs, this.gates, this.within]) map.clear();
    this.flights.end();
    this.drawing?.remove();
    const parsed = new DOMParser().parseFromString(drawn.picture, "image/svg+xml").documentElement;
    const drawing = (this.drawing = document.adoptNode(parsed) as unknown as SVGSVGElement);
    this.width = Number(drawing.getAttribute("width"));
    this.height = Number(drawing.getAttribute("height")) - TITLE_HEIGHT;
    drawing.setAttribute("role", "group");
    drawing.setAttribute("aria-label", `the net ${net.name}`);
    this.style.before(drawing);
    this.prepare(drawing, drawn.members);
    if (isFirst) this.fit();
    else this.zoomTo(this.scale);
    this.showAll();
    if (this.chosen) this.bring(this.choose(...this.chosen));
    if (hadFocus) this.element.focus();
  }

  private prepare(drawing: SVGSVGElement, members: Record<string, string[]>): void {
    for (const [task, places] of Object.entries(members)) for (const place of places) this.within.set(place, task);
    const says = new Map([...this.net.places, ...this.net.transitions].map((one) => [one.name, one.says]));
    for (const part of drawing.querySelectorAll<SVGElement>("[id]")) {
      const [kind, ...names] = part.id.split(":").map(decodeURIComponent);
      const name = names[0]!;
      if (kind === "place" && part instanceof SVGGElement) this.place(name, part, says.get(name) ?? "", members[name]);
      else if (kind === "transition" && part instanceof SVGGElement) this.transition(name, part, says.get(name) ?? "");
      else if (kind === "gate" && part instanceof SVGGElement) this.gate({ signal: names[1]!, wanted: names.length < 3, group: part }, name);
      else if (KINDS_OF_ARC.has(kind!) && part instanceof SVGPathElement) this.of(this.arcs, name).push({ path: part, backwards: KINDS_OF_ARC.get(kind!)! });
    }
  }

  private of<T>(map: Map<string, T[]>, name: string): T[] {
    const found = map.get(name) ?? [];
    map.set(name, found);
    return found;
  }

  private place(name: string, group: SVGGElement, says: string, members: string[] | undefined): void {
    group.querySelector("circle.token")?.remove();
    const circle = [...group.querySelectorAll("circle")].at(-1)!;
    const token = svg("circle", { class: "token live", cx: circle.getAttribute("cx")!, cy: circle.getAttribute("cy")!, r: 5.5 });
    circle.after(token);
    const task = members && `the task of ${members.join(", ")}`;
    this.spots.set(name, { group, token, label: [task ?? name, task ? "" : says].filter(Boolean).join(", ") });
    group.setAttribute("role", "img");
    if (task && this.pressing.task) {
      group.classList.add("task");
      group.setAttribute("tabindex", "0");
      this.pressed(group, () => this.pressing.task?.(name));
    }
    if (this.pressing.place) this.pressed(group, () => this.pressing.place?.(name));
  }

  private transition(name: string, group: SVGGElement, says: string): void {
    for (const bar of group.querySelectorAll<SVGRectElement>("rect.bar")) {
      const [x, y, width, height] = ["x", "y", "width", "height"].map((key) => Number(bar.getAttribute(key)));
      bar.before(svg("rect", { class: "hit", x: x! - 5, y: y! - 7, width: width! + 10, height: height! + 14, rx: 7 }));
    }
    group.classList.add("transition");
    group.setAttribute("data-says", says);
    group.setAttribute("role", "img");
    group.setAttribute("tabindex", "-1"); // what listens for the focus would be reached by Tab
    if (this.pressing.transition) this.pressed(group, () => this.pressing.transition?.(name));
    for (const kind of ["pointerenter", "focus"]) group.addEventListener(kind, () => this.pressing.pointed?.(name));
    for (const kind of ["pointerleave", "blur"]) group.addEventListener(kind, () => this.pressing.pointed?.(null));
    const all = this.of(this.bars, name);
    if (all.length > 0) group.setAttribute("aria-hidden", "true"); // it stands in the panel of other controllers, too
    all.push(group);
  }

  private gate(gate: Gate, transition: string): void {
    gate.group.classList.add("external");
    this.of(this.gates, transition).push(gate);
    if (!this.pressing.signal) return;
    gate.group.classList.add("switch");
    gate.group.addEventListener("click", () => this.pressing.signal?.(gate.signal));
  }

  private pressed(group: SVGGElement, act: () => void): void {
    group.setAttribute("role", "button");
    group.addEventListener("click", act);
    group.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      act();
    });
  }

  /** Go through places and transitions by the arrow keys; one of them is reached by Tab. */
  private rove(): void {
    this.root.addEventListener("keydown", (event) => {
      const to = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[(event as KeyboardEvent).key];
      if (to === undefined) return;
      const all = [...this.root.querySelectorAll<SVGGElement>("[role=button]:not([aria-hidden])")];
      const at = all.indexOf(event.target as SVGGElement);
      const next = all[(at + to + all.length) % all.length];
      if (at < 0 || next === undefined) return;
      event.preventDefault();
      for (const one of all) one.setAttribute("tabindex", one === next ? "0" : "-1");
      next.focus();
    });
  }

  /** Show which place or transition is chosen, and bring another one than before into sight. */
  choose(kind: string, name: string): Element[] {
    const isAnother = this.chosen?.[0] !== kind || this.chosen[1] !== name;
    this.chosen = [kind, name];
    const chosen = kind === "place" ? [this.spots.get(name)?.group] : (this.bars.get(name) ?? []);
    const all = [...[...this.spots.values()].map((one) => one.group), ...[...this.bars.values()].flat()];
    for (const one of all) {
      one.classList.toggle("chosen", chosen.includes(one));
      one.setAttribute("tabindex", one === (chosen[0] ?? all[0]) ? "0" : "-1");
      if (chosen.includes(one)) one.setAttribute("aria-pressed", "true");
      else one.removeAttribute("aria-pressed");
    }
    const there = chosen.filter((one) => one !== undefined);
    if (isAnother) this.bring(there);
    return there;
  }

  /** Show tokens, gates, and what may fire; of transitions that are not told what was told before holds on. */
  show(shown: Shown): void {
    this.marking = shown.marking;
    this.signals = shown.signals;
    for (const [name, wait] of Object.entries(shown.transitions)) {
      const before = this.waits.get(name);
      this.waits.set(name, wait);
      if (before?.may !== wait.may || before?.why !== wait.why) this.showBar(name, wait);
    }
    if (this.drawing === null) return;
    const held = this.holding(shown.marking);
    for (const name of held) if (!this.held.has(name)) this.showToken(name, true);
    for (const name of this.held) if (!held.has(name)) this.showToken(name, false);
    this.held = held;
    const on = new Set(shown.signals);
    const turned = on.size !== this.on.size || [...on].some((one) => !this.on.has(one));
    this.on = on;
    if (turned) this.showGates();
  }

  private showAll(): void {
    this.held = this.holding(this.marking);
    for (const name of this.spots.keys()) this.showToken(name, this.held.has(name));
    this.on = new Set(this.signals);
    this.showGates();
    for (const [name, wait] of this.waits) this.showBar(name, wait);
  }

  private holding(marking: Iterable<string>): Set<string> {
    const held = new Set<string>();
    for (const name of marking) held.add(this.within.get(name) ?? name);
    return held;
  }

  private showToken(name: string, there: boolean): void {
    const spot = this.spots.get(name);
    if (spot === undefined) return;
    spot.token.classList.toggle("there", there);
    spot.group.setAttribute("aria-label", there ? `${spot.label}, with a token` : spot.label);
  }

  private showGates(): void {
    for (const gates of this.gates.values())
      for (const gate of gates) gate.group.classList.toggle("open", this.on.has(gate.signal) === gate.wanted);
  }

  private showBar(name: string, wait: Wait): void {
    for (const [i, group] of (this.bars.get(name) ?? []).entries()) {
      for (const may of ["fire", "wait", "not"] as const) group.classList.toggle(`may-${may}`, wait.may === may);
      if (i > 0) continue;
      if (this.pressing.transition) group.setAttribute("tabindex", wait.may === "fire" ? "0" : "-1");
      const state = wait.may === "fire" ? "may fire" : (wait.why ?? "");
      group.setAttribute("aria-label", [name, group.getAttribute("data-says"), state].filter(Boolean).join(", "));
    }
  }

  /** Mark what a transition waits for; null marks nothing. */
  mark(name: string | null): void {
    for (const one of this.marked) one.classList.remove("missing");
    this.marked.clear();
    const wait = name === null ? undefined : this.waits.get(name);
    if (name === null || wait === undefined || wait.may === "fire") return;
    for (const place of [...(wait.empty ?? []), ...(wait.full ?? [])]) {
      const spot = this.spots.get(this.within.get(place) ?? place);
      if (spot) this.marked.add(spot.group);
    }
    for (const gate of this.gates.get(name) ?? []) if (wait.closed?.includes(gate.signal)) this.marked.add(gate.group);
    for (const one of this.marked) one.classList.add("missing");
  }

  /** Let tokens run along the arcs of what has fired. */
  fly(fired: Iterable<string>): void {
    for (const name of fired) this.flights.fly(this.bars.get(name) ?? [], this.arcs.get(name) ?? []);
  }

  // How large it is shown, and what of it

  /** Scroll to what has fired, if nothing of it is in sight. */
  reveal(fired: Iterable<string>): void {
    this.bring([...fired].flatMap((name) => this.bars.get(name) ?? []));
  }

  private bring(parts: Element[]): void {
    const room = this.element.getBoundingClientRect();
    const bars = parts.map((part) => part.getBoundingClientRect());
    const inSight = (bar: DOMRect): boolean => bar.top >= room.top && bar.bottom <= room.bottom && bar.right > room.left && bar.left < room.right;
    if (bars.length === 0 || bars.some(inSight)) return;
    const { x, y, width, height } = bars[0]!;
    this.element.scrollBy(x + width / 2 - (room.x + room.width / 2), y + height / 2 - (room.y + room.height / 2));
  }

  /** As large as fits the width, but readable. */
  fit(): void {
    const room = this.element.clientWidth - 2;
    this.zoomTo(Math.min(1, Math.max(0.45, room / this.width)));
  }

  zoom(factor: number): void {
    this.zoomTo(Math.min(3, Math.max(0.2, this.scale * factor)));
  }

  private zoomTo(scale: number): void {
    const { element, drawing } = this;
    if (drawing === null) return;
    const x = (element.scrollLeft + element.clientWidth / 2) / (this.width * this.scale);
    const y = (element.scrollTop + element.clientHeight / 2) / (this.height * this.scale);
    this.scale = scale;
    drawing.setAttribute("viewBox", `0 ${TITLE_HEIGHT} ${this.width} ${this.height}`);
    drawing.setAttribute("width", String(this.width * scale));
    drawing.setAttribute("height", String(this.height * scale));
    element.scrollLeft = x * this.width * scale - element.clientWidth / 2;
    element.scrollTop = y * this.height * scale - element.clientHeight / 2;
  }

  private pan(): void {
    let from: { x: number; y: number } | null = null;
    let moved = 0;
    this.element.addEventListener("pointerdown", (event) => {
      moved = 0;
      if (event.pointerType === "mouse" && event.button === 0) from = { x: event.clientX, y: event.clientY };
    });
    addEventListener("pointermove", (event) => {
      if (from === null) return;
      this.element.scrollBy(from.x - event.clientX, from.y - event.clientY);
      moved += Math.hypot(from.x - event.clientX, from.y - event.clientY);
      from = { x: event.clientX, y: event.clientY };
    });
    addEventListener("pointerup", () => (from = null));
    // What was dragged has moved with the pointer, which is released over it: that is no click.
    this.element.addEventListener("click", (event) => moved > DRAGGED && event.stopPropagation(), { capture: true });
    this.element.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        this.zoom(event.deltaY < 0 ? 1.15 : 1 / 1.15);
      },
      { passive: false },
    );
  }
}
