// The picture of the net: the SVG that `firable draw` makes, in which tokens come and go. Its parts are found by the ids
// that the drawing gives them. It stands in a shadow tree, because its style sheet speaks of `text` and `.name` as if it
// were alone. What is drawn here is only what changes: tokens, who may fire, open gates, and tokens on their way.
//
// It may be there before it is drawn, and be drawn anew with tasks folded: what is to be shown is kept, and shown then.

import { h, svg } from "./dom";
import { Flights, type Arc } from "./flights";
import pictureStyle from "./picture.css?inline";
import type { Drawn, Net, Owner, Wait } from "./server";

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
  /** A controller that is drawn as one line. */
  controller?: (name: Owner) => void;
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

/** A controller in an overview: its line in each system, and what says where its tokens are. */
interface Line {
  groups: SVGGElement[];
  held: SVGTextElement[];
}

/** So much of the top is left out: the title of the drawing stands in the head of the page. */
const TITLE_HEIGHT = 56;
/** Who moves the pointer by so many pixels between press and release drags the picture. */
const DRAGGED = 5;
/** So many characters say where the tokens of a controller are: as many as in the drawing. */
const HELD_MAX = 20;
const shortened = (text: string, characters: number): string => (text.length <= characters ? text : `${text.slice(0, characters - 1)}…`);
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
  private readonly lines = new Map<Owner, Line>();
  /** The owner of each place, and those who take part in each transition. */
  private readonly owner = new Map<string, Owner>();
  private readonly owners = new Map<string, Owner[]>();
  /** What is fired in the run that is played. */
  private passed: ReadonlySet<string> | null = null;
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

  get isDrawn(): boolean {
    return this.drawing !== null;
  }

  /** Show a drawing; one that takes the place of another of the same is as large, and stands where that one stood. */
  draw(net: Net, drawn: Drawn, isOther: boolean): void {
    this.net = net;
    const hadFocus = this.root.activeElement !== null;
    for (const map of [this.spots, this.bars, this.arcs, this.gates, this.lines, this.owner, this.owners, this.within]) map.clear();
    for (const { name, owner } of net.places) this.owner.set(name, owner);
    for (const { name, owners } of net.transitions) this.owners.set(name, owners);
    this.flights.end();
    this.drawing?.remove();
    const parsed = new DOMParser().parseFromString(drawn.picture, "image/svg+xml").documentElement;
    const drawing = (this.drawing = document.adoptNode(parsed) as unknown as SVGSVGElement);
    this.width = Number(drawing.getAttribute("width"));
    this.height = Number(drawing.getAttribute("height")) - TITLE_HEIGHT;
    drawing.setAttribute("role", "group");
    drawing.setAttribute("aria-label", `the net ${net.name}`);
    this.style.before(drawing);
    this.prepare(drawing, drawn);
    if (isOther) {
      this.fit();
      this.element.scrollTo(0, 0);
    } else this.zoomTo(this.scale);
    this.passes(this.passed);
    this.showAll();
    if (this.chosen) this.bring(this.choose(...this.chosen));
    if (hadFocus) this.element.focus();
  }

  private prepare(drawing: SVGSVGElement, { members, owners }: Drawn): void {
    for (const [task, places] of Object.entries(members)) for (const place of places) this.within.set(place, task);
    const says = new Map([...this.net.places, ...this.net.transitions].map((one) => [one.name, one.says]));
    for (const part of drawing.querySelectorAll<SVGElement>("[id]")) {
      const [kind, ...names] = part.id.split(":").map(decodeURIComponent);
      const name = names[0]!;
      if (kind === "place" && part instanceof SVGGElement) this.place(name, part, says.get(name) ?? "", members[name]);
      else if (kind === "transition" && part instanceof SVGGElement) this.transition(name, part, says.get(name) ?? "");
      else if (kind === "gate" && part instanceof SVGGElement) this.gate({ signal: names[1]!, wanted: names.length < 3, group: part }, name);
      else if (kind === "controller" && part instanceof SVGGElement) this.line(name || null, part, owners);
      else if (KINDS_OF_ARC.has(kind!) && part instanceof SVGPathElement) this.of(this.arcs, name).push({ path: part, backwards: KINDS_OF_ARC.get(kind!)! });
    }
  }

  private line(owner: Owner, group: SVGGElement, owners: Owner[]): void {
    const line = this.lines.get(owner) ?? { groups: [], held: [] };
    this.lines.set(owner, line);
    line.groups.push(group);
    line.held.push(group.querySelector<SVGTextElement>(".held")!);
    group.classList.add("controller");
    group.setAttribute("role", "img");
    if (line.groups.length > 1) group.setAttribute("aria-hidden", "true"); // it stands in a system above, too
    const meets = [...this.owners].filter(([, some]) => some.includes(owner)).map(([name]) => name);
    this.setsOff(group, () => meets.flatMap((name) => [...(this.bars.get(name) ?? []), ...this.linesOf(name)]));
    if (!owners.includes(owner)) return; // it owns nothing that could be drawn
    this.pressed(group, () => this.pressing.controller?.(owner));
    group.setAttribute("tabindex", "-1"); // who goes by Tab finds them in the list of those to open
  }

  /** In an overview: who points at a part sees what it has to do with. */
  private setsOff(part: SVGGElement, of: () => SVGGElement[]): void {
    for (const [kind, isOn] of [["pointerenter", true], ["pointerleave", false]] as const)
      part.addEventListener(kind, () => of().forEach((one) => one.classList.toggle("beside", isOn)));
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
      const [x = 0, y = 0, width = 0, height = 0] = ["x", "y", "width", "height"].map((key) => Number(bar.getAttribute(key)));
      const [across, along] = height > width ? [3, 3] : [5, 7];
      bar.before(svg("rect", { class: "hit", x: x - across, y: y - along, width: width + 2 * across, height: height + 2 * along, rx: across + 2 }));
    }
    group.classList.add("transition");
    group.setAttribute("data-says", says);
    group.setAttribute("role", "img");
    group.setAttribute("tabindex", "-1"); // what listens for the focus would be reached by Tab
    if (this.pressing.transition) this.pressed(group, () => this.pressing.transition?.(name));
    for (const kind of ["pointerenter", "focus"]) group.addEventListener(kind, () => this.pressing.pointed?.(name));
    for (const kind of ["pointerleave", "blur"]) group.addEventListener(kind, () => this.pressing.pointed?.(null));
    this.setsOff(group, () => this.linesOf(name));
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
    this.showLines();
    const on = new Set(shown.signals);
    const turned = on.size !== this.on.size || [...on].some((one) => !this.on.has(one));
    this.on = on;
    if (turned) this.showGates();
  }

  private showAll(): void {
    this.held = this.holding(this.marking);
    for (const name of this.spots.keys()) this.showToken(name, this.held.has(name));
    this.showLines();
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

  /** In an overview: on which place the tokens of each controller are, and on how many more. */
  private showLines(): void {
    if (this.lines.size === 0) return;
    const held = new Map<Owner, string[]>();
    for (const place of this.marking) {
      const owner = this.owner.get(place) ?? null;
      held.set(owner, [...(held.get(owner) ?? []), owner !== null && place.startsWith(`${owner}.`) ? place.slice(owner.length + 1) : place]);
    }
    for (const [owner, { groups, held: texts }] of this.lines) {
      const on = held.get(owner) ?? [];
      const more = on.length > 1 ? ` +${on.length - 1}` : "";
      const words = on.length > 0 ? shortened(on[0]!, HELD_MAX - more.length) + more : "";
      for (const text of texts) if (text.textContent !== words) text.textContent = words;
      groups[0]!.setAttribute("aria-label", `${owner ?? "no controller"}, ${on.length > 0 ? `tokens on ${on.join(", ")}` : "no token"}`);
    }
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
    for (const name of fired) this.flights.fly([...(this.bars.get(name) ?? []), ...this.linesOf(name)], this.arcs.get(name) ?? []);
  }

  /** In an overview: the lines of those who take part in a transition. */
  private linesOf(name: string): SVGGElement[] {
    return (this.owners.get(name) ?? []).flatMap((owner) => this.lines.get(owner)?.groups ?? []);
  }

  /** In an overview: set off what a run passes through from all that it leaves alone; null sets nothing off. */
  passes(fired: ReadonlySet<string> | null): void {
    this.passed = fired;
    this.drawing?.classList.toggle("passing", fired !== null && this.lines.size > 0);
    for (const [name, bars] of this.bars) for (const bar of bars) bar.classList.toggle("passed", fired?.has(name) ?? false);
    const passed = new Set([...(fired ?? [])].flatMap((name) => this.linesOf(name)));
    for (const { groups } of this.lines.values()) for (const group of groups) group.classList.toggle("passed", passed.has(group));
  }

  // How large it is shown, and what of it

  /** Scroll to what has fired, if nothing of it is in sight. */
  reveal(fired: Iterable<string>): void {
    this.bring([...fired].flatMap((name) => this.bars.get(name) ?? this.linesOf(name).slice(0, 1)));
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
