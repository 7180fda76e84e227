// Tokens on their way: what has fired sends a dot along each of its arcs, first those it takes and then those it puts.

import { calm, svg } from "./dom";

export interface Arc {
  path: SVGPathElement;
  /** Whether the line is drawn from the place, and the token runs to it. */
  backwards: boolean;
  length?: number;
}

interface Flight extends Arc {
  circle: SVGCircleElement;
  length: number;
  begin: number;
}

const FLIGHT_MS = 420;
const FLIGHTS_MAX = 48;
const TURN_MS = 210;

export class Flights {
  private flights: Flight[] = [];

  /** Let tokens run along the arcs of a transition, whose bars are marked meanwhile. */
  fly(bars: readonly Element[], arcs: readonly Arc[]): void {
    if (calm() || document.hidden) return;
    const now = performance.now();
    const idle = this.flights.length === 0;
    for (const bar of bars) {
      if (bar.classList.contains("fired-now")) continue;
      bar.classList.add("fired-now");
      setTimeout(() => bar.classList.remove("fired-now"), FLIGHT_MS + TURN_MS);
    }
    for (const arc of arcs) {
      if (this.flights.length >= FLIGHTS_MAX) break;
      const circle = svg("circle", { class: "token flying", r: 5, cx: -50, cy: -50 });
      arc.path.ownerSVGElement!.append(circle);
      arc.length ??= arc.path.getTotalLength();
      this.flights.push({ ...arc, length: arc.length, circle, begin: now + (arc.backwards ? TURN_MS : 0) });
    }
    if (idle && this.flights.length > 0) requestAnimationFrame((at) => this.flown(at));
  }

  /** Nothing is on its way any more: the picture is another one. */
  end(): void {
    this.flights = [];
  }

  private flown(now: number): void {
    this.flights = this.flights.filter(({ circle, path, length, backwards, begin }) => {
      const done = (now - begin) / (FLIGHT_MS - TURN_MS);
      if (done >= 1) circle.remove();
      else if (done >= 0) {
        const point = path.getPointAtLength(length * (backwards ? 1 - done : done));
        circle.setAttribute("cx", String(point.x));
        circle.setAttribute("cy", String(point.y));
      }
      return done < 1;
    });
    if (this.flights.length > 0) requestAnimationFrame((at) => this.flown(at));
  }
}
