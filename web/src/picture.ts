// The picture of the net: the SVG that `firable draw` makes, in which tokens come and go. Its parts are found by the ids
// that the drawing gives them. It stands in a shadow tree, because its style sheet speaks of `text` and `.name` as if it
// were alone. What is drawn here is only what changes: tokens, who may fire, open gates, and tokens on their way.

import { calm, svg } from "./dom";
import pictureStyle from "./picture.css?inline";
import type { Net, Wait } from "./server";

export interface Shown {
  marking: Iterable<string>;
  signals: Iterable<string>;
  transitions: Record<string, Wait>;
}

interface Flight {
  circle: SVGCircleElement;
  path: SVGPathElement;
  length: number;
  backwards: boolean;
  begin: number;
}

const FLIGHT_MS = 420;
const FLIGHTS_MAX = 48;
const TURN_MS = 210;
/** So much of the top is left out: the title of the drawing stands in the head of the page. */
const TITLE_HEIGHT = 56;

// The names of the net in the ids are written as Python's `quote` writes them.
const quoted = (name: string): string =>
  encodeURIComponent(name).replace(/[!'()*]/g, (c) => `%${c.charCodeAt(0).toString(16).toUpperCase()}`).replace(/%2F/g, "/");

export class Picture {
  readonly element: HTMLElement;
  private drawing!: SVGSVGElement;
  private readonly tokens = new Map<string, SVGCircleElement>();
  private readonly bars = new Map<string, SVGGElement>();
  private readonly places = new Map<string, SVGGElement>();
  private readonly gates: { signal: string; wanted: boolean; group: SVGGElement }[] = [];
  private readonly flights: Flight[] = [];
  private width = 0;
  private height = 0;
  private scale = 1;
  private told: Record<string, Wait> = {};
  private readonly marked = new Set<string>();

  constructor(
    private net: Net,
    text: string,
    private readonly on: {
      place?: (name: string) => void;
      transition?: (name: string) => void;
      signal?: (name: string) => void;
      pointed?: (name: string | null) => void;
    },
  ) {
    this.element = document.createElement("div");
    this.element.className = "picture";
    const style = document.createElement("style");
    style.textContent = pictureStyle;
    this.element.attachShadow({ mode: "open" }).append(style);
    this.draw(net, text);
    this.pan();
    if (this.on.place) this.rove();
  }

  /** Show another drawing, of the same size and at the same place as the one before. */
  draw(net: Net, text: string): void {
    this.net = net;
    for (const map of [this.tokens, this.bars, this.places]) map.clear();
    this.gates.length = this.flights.length = 0;
    this.told = {};
    this.drawing?.remove();
    const parsed = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    this.drawing = document.adoptNode(parsed) as unknown as SVGSVGElement;
    this.width = Number(this.drawing.getAttribute("width"));
    this.height = Number(this.drawing.getAttribute("height")) - TITLE_HEIGHT;
    this.drawing.setAttribute("role", "group");
    this.drawing.setAttribute("aria-label", `the net ${net.name}`);
    this.element.shadowRoot!.prepend(this.drawing);
    this.prepare();
    this.zoomTo(this.scale);
  }

  private found<T extends Element>(...names: [string, ...string[]]): T | null {
    const [kind, ...rest] = names;
    return this.element.shadowRoot!.getElementById([kind, ...rest.map(quoted)].join(":")) as T | null;
  }

  private prepare(): void {
    for (const place of this.net.places) {
      const group = this.found<SVGGElement>("place", place.name);
      const circle = group?.querySelector("circle.place");
      if (!group || !circle) continue;
      group.querySelector("circle.token")?.remove();
      const at = { cx: circle.getAttribute("cx")!, cy: circle.getAttribute("cy")!, r: 5.5 };
      const token = svg("circle", { class: "token live", ...at });
      circle.after(token);
      group.setAttribute("role", "img");
      this.tokens.set(place.name, token);
      this.places.set(place.name, group);
      if (this.on.place) this.pressed(group, () => this.on.place?.(place.name));
      if (this.on.place) group.setAttribute("aria-label", [place.name, place.says].filter(Boolean).join(", "));
    }
    for (const { name, says } of this.net.transitions) {
      const group = this.found<SVGGElement>("transition", name);
      if (group === null) continue;
      for (const bar of group.querySelectorAll<SVGRectElement>("rect.bar")) {
        const [x, y, width, height] = ["x", "y", "width", "height"].map((key) => Number(bar.getAttribute(key)));
        bar.before(svg("rect", { class: "hit", x: x! - 5, y: y! - 7, width: width! + 10, height: height! + 14, rx: 7 }));
      }
      group.classList.add("transition");
      group.setAttribute("data-says", says);
      this.pressed(group, () => this.on.transition?.(name));
      for (const kind of ["pointerenter", "focus"]) group.addEventListener(kind, () => this.on.pointed?.(name));
      for (const kind of ["pointerleave", "blur"]) group.addEventListener(kind, () => this.on.pointed?.(null));
      this.bars.set(name, group);
    }
    for (const signal of this.net.signals) {
      for (const transition of signal.gates) {
        for (const wanted of [true, false]) {
          const group = this.found<SVGGElement>("gate", transition, signal.name, ...(wanted ? [] : ["0"]));
          if (group === null) continue;
          group.classList.add("external");
          if (this.on.signal) {
            group.classList.add("switch");
            group.addEventListener("click", () => this.on.signal?.(signal.name));
          }
          this.gates.push({ signal: signal.name, wanted, group });
        }
      }
    }
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
    this.element.shadowRoot!.addEventListener("keydown", (event) => {
      const to = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[(event as KeyboardEvent).key];
      if (to === undefined) return;
      const all = [...this.element.shadowRoot!.querySelectorAll<SVGGElement>("[role=button]")];
      const at = all.indexOf(event.target as SVGGElement);
      const next = all[(at + to + all.length) % all.length];
      if (at < 0 || next === undefined) return;
      event.preventDefault();
      for (const one of all) one.setAttribute("tabindex", one === next ? "0" : "-1");
      next.focus();
    });
  }

  /** Show which place or transition is chosen. */
  choose(kind: string, name: string): void {
    const chosen = kind === "place" ? this.places.get(name) : this.bars.get(name);
    const all = [...this.places.values(), ...this.bars.values()];
    for (const one of all) {
      one.classList.toggle("chosen", one === chosen);
      one.setAttribute("tabindex", one === (chosen ?? all[0]) ? "0" : "-1");
      if (one === chosen) one.setAttribute("aria-pressed", "true");
      else one.removeAttribute("aria-pressed");
    }
  }

  /** Show tokens, gates, and what may fire. */
  show(shown: Shown): void {
    const marking = new Set(shown.marking);
    for (const [name, token] of this.tokens) token.classList.toggle("there", marking.has(name));
    const signals = new Set(shown.signals);
    for (const gate of this.gates) gate.group.classList.toggle("open", signals.has(gate.signal) === gate.wanted);
    for (const [name, wait] of Object.entries(shown.transitions)) {
      const before = this.told[name];
      if (before !== undefined && before.may === wait.may && before.why === wait.why) continue;
      const group = this.bars.get(name);
      if (group === undefined) continue;
      for (const may of ["fire", "wait", "not"] as const) group.classList.toggle(`may-${may}`, wait.may === may);
      const playable = this.on.transition !== undefined;
      group.setAttribute("tabindex", playable && wait.may === "fire" ? "0" : "-1");
      const says = group.getAttribute("data-says");
      const state = wait.may === "fire" ? "may fire" : (wait.why ?? "");
      group.setAttribute("aria-label", [name, says, state].filter(Boolean).join(", "));
    }
    this.told = { ...this.told, ...shown.transitions };
  }

  /** Mark what a transition waits for; null marks nothing. */
  mark(name: string | null): void {
    for (const id of this.marked) this.element.shadowRoot!.getElementById(id)?.classList.remove("missing");
    this.marked.clear();
    const wait = name === null ? undefined : this.told[name];
    if (name === null || wait === undefined || wait.may === "fire") return;
    const ids = [...(wait.empty ?? []), ...(wait.full ?? [])].map((place) => `place:${quoted(place)}`);
    for (const signal of wait.closed ?? [])
      ids.push(`gate:${quoted(name)}:${quoted(signal)}`, `gate:${quoted(name)}:${quoted(signal)}:0`);
    for (const id of ids) {
      this.element.shadowRoot!.getElementById(id)?.classList.add("missing");
      this.marked.add(id);
    }
  }

  /** Let tokens run along the arcs of what has fired. */
  fly(fired: Iterable<string>): void {
    if (calm() || document.hidden) return;
    const now = performance.now();
    for (const name of fired) {
      const group = this.bars.get(name);
      if (group !== undefined && !group.classList.contains("fired-now")) {
        group.classList.add("fired-now");
        setTimeout(() => group.classList.remove("fired-now"), FLIGHT_MS + TURN_MS);
      }
      for (const [kind, backwards] of [["input", false], ["output", true]] as const) {
        for (const path of this.element.shadowRoot!.querySelectorAll<SVGPathElement>(
          `path[id^="${CSS.escape(kind)}:${quoted(name)}:"]`,
        )) {
          if (this.flights.length >= FLIGHTS_MAX) return;
          const circle = svg("circle", { class: "token flying", r: 5, cx: -50, cy: -50 });
          this.drawing.append(circle);
          const begin = now + (backwards ? TURN_MS : 0);
          this.flights.push({ circle, path, length: path.getTotalLength(), backwards, begin });
        }
      }
    }
    if (this.flights.length > 0) requestAnimationFrame((at) => this.flown(at));
  }

  private flown(now: number): void {
    for (let i = this.flights.length - 1; i >= 0; i--) {
      const flight = this.flights[i]!;
      const done = (now - flight.begin) / (FLIGHT_MS - TURN_MS);
      if (done >= 1) {
        flight.circle.remove();
        this.flights.splice(i, 1);
      } else if (done >= 0) {
        const point = flight.path.getPointAtLength(flight.length * (flight.backwards ? 1 - done : done));
        flight.circle.setAttribute("cx", String(point.x));
        flight.circle.setAttribute("cy", String(point.y));
      }
    }
    if (this.flights.length > 0) requestAnimationFrame((at) => this.flown(at));
  }

  // How large it is shown

  /** As large as fits the width, but readable. */
  fit(): void {
    const room = this.element.clientWidth - 2;
    this.zoomTo(Math.min(1, Math.max(0.45, room / this.width)));
  }

  zoom(factor: number): void {
    this.zoomTo(Math.min(3, Math.max(0.2, this.scale * factor)));
  }

  private zoomTo(scale: number): void {
    const { element } = this;
    const x = (element.scrollLeft + element.clientWidth / 2) / (this.width * this.scale);
    const y = (element.scrollTop + element.clientHeight / 2) / (this.height * this.scale);
    this.scale = scale;
    this.drawing.setAttribute("viewBox", `0 ${TITLE_HEIGHT} ${this.width} ${this.height}`);
    this.drawing.setAttribute("width", String(this.width * scale));
    this.drawing.setAttribute("height", String(this.height * scale));
    element.scrollLeft = x * this.width * scale - element.clientWidth / 2;
    element.scrollTop = y * this.height * scale - element.clientHeight / 2;
  }

  private pan(): void {
    let from: { x: number; y: number } | null = null;
    this.element.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse" && event.button === 0) from = { x: event.clientX, y: event.clientY };
    });
    addEventListener("pointermove", (event) => {
      if (from === null) return;
      this.element.scrollBy(from.x - event.clientX, from.y - event.clientY);
      from = { x: event.clientX, y: event.clientY };
    });
    addEventListener("pointerup", () => (from = null));
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
