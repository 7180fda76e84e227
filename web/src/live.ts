// A running cell: what the server tells of it is shown as it comes, and what the operator may do is asked of it. When
// nothing comes any more, that is said, and what is shown is marked as old: a page that looks alive and is not is the
// one thing that must never be here.

import { announce, counted, h, paced } from "./dom";
import { Drawing } from "./drawing";
import { banner, frame, panel, type Frame } from "./frame";
import { Lanes, type Bar } from "./lanes";
import type { Picture } from "./picture";
import { ask, follow, Refused, type Net, type Wait } from "./server";
import { TopView, type Top, type TopStart } from "./top_view";

export interface LiveStart {
  mode: "live";
  here: string;
  coordinators: string[];
  net: Net;
  machines: string[];
  top: TopStart;
}

interface Votes {
  name: string;
  says: string;
  round: "" | "asking" | "applying";
  parts: { controller: string; vote: string }[];
}

interface Now {
  at: number;
  speed: number;
  state: string;
  message: string;
  marking: string[];
  signals: string[];
  transitions: Record<string, Wait>;
  waits: string[];
  bars: Bar[];
  votes: Votes[];
  unreached: string[];
  top: Top | null;
  /** Commands of which no machine can tell, by their places: the operator is asked. */
  asked: Record<string, string>;
  paused: boolean;
  ended: boolean;
  events: { at: number; kind: string; what: string }[];
  fired: string[];
}

const SILENT_MS = 2500;
const RETRY_MS = 1000;
const EVENTS_SHOWN = 200;
const COLUMNS_MAX = 12;
/** When more fires in a second, no eye follows the tokens on their way. */
const FLYING_MAX = 12;
const ANSWERS = [["done", "Done"], ["working", "Working"], ["not received", "Not received"]] as const;
const BAD = new Set(["fault", "deadlock", "latched"]);
const SIGNS: Record<string, [string, string]> = {
  ready: ["●", "ready"], yes: ["✓", "votes yes"], promised: ["◐", "has promised"], no: ["○", "not ready"], ordered: ["…", "has its order"],
  applied: ["✓", "has applied"], lost: ["✗", "not connected"], unknown: ["?", "not known here"],
};

export class Live {
  private readonly picture: Picture;
  private readonly top: TopView;
  private readonly frame: Frame;
  private readonly lanes: Lanes;
  private readonly waits = h("ul", { class: "list" });
  private readonly questions = h("div", { class: "list" });
  private readonly votes = h("table", { class: "votes" });
  private readonly rows = new Map<string, Votes>();
  private readonly shownRows = new Map<string, HTMLElement>();
  private isWide = false;
  private readonly changedRows = new Set<string>();
  private readonly drawVotes = paced(() => this.showVotes());
  private readonly untold: Now["events"] = [];
  private readonly drawEvents = paced(() => this.showEvents());
  private readonly drawWaits = paced(() => this.showWaits());
  private readonly drawLanes = paced(() => this.showLanes());
  private readonly signals = h("ul", { class: "signals" });
  private readonly events = h("ol", { class: "log events", "aria-label": "What happened, the newest first", tabindex: "0" });
  private readonly buttons: HTMLButtonElement[] = [];
  private readonly pauseButton: HTMLButtonElement;
  private readonly stepButton: HTMLButtonElement;
  private readonly resetButton: HTMLButtonElement;
  private heard = performance.now();
  private now: Now | null = null;
  private lost = false;
  /** So much has fired in about the last second. */
  private pace = 0;
  private shownAt = 0;
  private said = "";

  constructor(start: LiveStart) {
    const drawing = new Drawing(start.net, { pointed: (name) => this.picture.mark(name) });
    this.picture = drawing.picture;
    this.top = new TopView(start.top);
    this.lanes = new Lanes(start.machines);
    const says = start.here ? `on this host: ${start.here}` : start.net.description;
    this.frame = frame(start.net.name || "the cell", says, "Operating", drawing, this.top);
    void drawing.draw(start.net, null);
    document.body.classList.add("live");
    const button = (words: string, path: string, title: string, kind = ""): HTMLButtonElement => {
      const made = h("button", { type: "button", class: kind, title, click: () => void this.command(made.dataset.path ?? path, words) }, words);
      this.frame.tools.append(made);
      this.buttons.push(made);
      return made;
    };
    this.pauseButton = button("Pause", "pause", "Let nothing fire; machines end what they are at");
    this.stepButton = button("Step", "step", "While paused, fire one transition");
    button("Stop at end of cycle", "stop-at-end", "Let no new work in, and end when the cell is empty");
    button("Stop", "stop", "Stop every machine where it is, and end the run");
    // A button of its own: one that turns into Resume under a second click would start machines.
    this.resetButton = button("Reset", "reset", "After an emergency stop: have the machines asked what they did. Nothing moves before Resume");
    this.resetButton.hidden = true;
    button("Emergency stop", "emergency-stop", "Drive the safe outputs at once. This is no safety function: the wired one is", "emergency");
    const lanes = h("section", { class: "machines", "aria-label": "Machines" }, this.lanes.element);
    if (start.machines.length > 0) this.frame.below.append(lanes);
    this.frame.side.append(
      panel("Waits for", this.questions, this.waits),
      panel("Votes", this.votes),
      panel("Signals", this.signals),
      panel("What happened", this.events),
    );
    for (const { name } of start.net.signals) this.signals.append(h("li", { "data-signal": name }, h("i", { "aria-hidden": "true" }, "○"), ` ${name} `, h("b", {}, "0")));
    setInterval(() => this.watch(), 250);
    void this.listen();
  }

  private async listen(): Promise<void> {
    for (;;) {
      const stop = new AbortController();
      const watch = setInterval(() => {
        if (performance.now() - this.heard > SILENT_MS) stop.abort();
      }, 250);
      try {
        this.heard = performance.now();
        for await (const now of follow<Now>("api/events", stop.signal)) {
          this.heard = performance.now();
          this.show(now);
          if (now.ended) return this.end(now);
        }
      } catch (error) {
        if (error instanceof Refused) return void banner(this.frame.banner, "bad", `The run does not let this page in any more: ${error.message}.`);
      } finally {
        clearInterval(watch);
      }
      this.lose();
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    }
  }

  private lose(): void {
    if (this.lost) return;
    this.lost = true;
    const at = new Date().toLocaleTimeString();
    document.body.classList.add("old");
    banner(this.frame.banner, "bad", `The connection is lost since ${at}. What is shown is old, and nothing here reaches the cell: use the controls at the machines.`);
    for (const one of [...this.buttons, ...this.questions.querySelectorAll("button")]) one.disabled = true;
    this.questions.dataset.key = ""; // to be asked again, then
    this.frame.status.textContent = "no connection";
    this.frame.status.className = "status bad";
  }

  private watch(): void {
    if (this.now === null || this.now.ended || this.lost) return;
    this.drawLanes();
  }

  private showLanes(): void {
    if (this.now === null || this.lost) return;
    // Between two frames time goes on; it is shown only as long as the connection lives.
    const since = this.now.ended ? 0 : Math.min(performance.now() - this.heard, 700) / 1000;
    this.lanes.at(this.now.at + since * this.now.speed);
  }

  private show(now: Now): void {
    if (this.lost) {
      this.lost = false;
      document.body.classList.remove("old");
      this.frame.banner.replaceChildren();
      this.said = ""; // what the run has to say is said again, in place of what was said of the connection
      announce("The connection is back.");
    }
    this.pace = this.pace * Math.exp((this.shownAt - this.heard) / 1000) + now.fired.length;
    this.shownAt = this.heard;
    this.now = now;
    this.picture.element.classList.toggle("brisk", this.pace > FLYING_MAX);
    this.picture.show(now);
    if (this.pace <= FLYING_MAX) this.picture.fly(new Set(now.fired));
    if (now.top) this.top.show(now.top, 0.2, now.speed);
    this.lanes.take(now.bars);
    this.drawLanes();
    this.showState(now);
    for (const row of now.votes) {
      this.rows.set(row.name, row);
      this.changedRows.add(row.name);
    }
    if (now.votes.length > 0) this.drawVotes();
    this.drawWaits();
    if (now.events.length > 0) {
      this.untold.push(...now.events);
      this.untold.splice(0, Math.max(0, this.untold.length - EVENTS_SHOWN));
      this.drawEvents();
    }
    const on = new Set(now.signals);
    for (const one of this.signals.children as HTMLCollectionOf<HTMLElement>) {
      const value = on.has(one.dataset.signal!);
      if (one.classList.toggle("on", value) !== (one.lastElementChild!.textContent === "1")) {
        one.firstElementChild!.textContent = value ? "●" : "○";
        one.lastElementChild!.textContent = value ? "1" : "0";
      }
    }
  }

  private showState(now: Now): void {
    const { state, message } = now;
    const words = message ? `${state}: ${message}` : state;
    const isOpen = state === "paused" || state === "held" || (message !== "" && state !== "done");
    const kind = BAD.has(state) ? "bad" : isOpen ? "open" : "good";
    this.frame.status.className = `status ${kind}`;
    const clock = `${now.at.toFixed(1)} s`;
    this.frame.status.replaceChildren(h("b", { class: `state ${kind}` }, state), h("span", { class: "soft clock" }, clock));
    if (words !== this.said) {
      this.said = words;
      if (state !== "running" && state !== "waiting") announce(words);
      if (message || kind !== "good") banner(this.frame.banner, kind, words);
      else this.frame.banner.replaceChildren();
    }
    const held = now.paused || state === "held";
    const path = held ? "resume" : "pause";
    if (this.pauseButton.dataset.path !== path) {
      this.pauseButton.dataset.path = path;
      this.pauseButton.textContent = held ? "Resume" : "Pause";
    }
    const over = now.ended || state === "stopped" || state === "done" || state === "fault";
    for (const one of this.buttons) one.disabled = over && !one.classList.contains("emergency");
    if (!over) this.stepButton.disabled = !now.paused;
    const latched = state === "latched";
    this.resetButton.hidden = !latched;
    if (latched) this.pauseButton.disabled = this.stepButton.disabled = true;
  }

  private showQuestions(asked: Record<string, string>): void {
    const key = JSON.stringify(asked);
    if (this.questions.dataset.key === key) return;
    this.questions.dataset.key = key;
    const answer = (place: string, word: string, words: string): HTMLElement =>
      h("button", { type: "button", class: "small", "aria-label": `${words}: ${place}`, click: () => void this.command(`say?${new URLSearchParams({ place, answer: word })}`, `${place}: ${words}`) }, words);
    this.questions.replaceChildren(...Object.entries(asked).map(([place, command]) =>
      h("div", { class: "wait asked", role: "group", "aria-label": `What became of ${command}?` },
        h("span", {}, `${place}: look at the machine. What became of ${command}?`), ...ANSWERS.map(([word, words]) => answer(place, word, words)))));
  }

  private showWaits(): void {
    const now = this.now;
    if (now === null) return;
    this.showQuestions(now.ended ? {} : now.asked);
    const away = now.unreached.map((name) => `${name === "" ? "the coordinator" : name} is not connected`);
    const lines = [...away, ...now.waits];
    const none = Object.keys(now.asked).length > 0 ? "" : now.state === "running" ? "Nothing: the cell is at work." : "Nothing.";
    const key = [none, ...lines].join("\n");
    if (this.waits.dataset.key === key) return;
    this.waits.dataset.key = key;
    const shown: [string, string][] = lines.length > 0 ? lines.map((line, i) => [i < away.length ? "wait lost" : "wait", line]) : [["none", none]];
    while (this.waits.children.length > shown.length) this.waits.lastElementChild!.remove();
    while (this.waits.children.length < shown.length) this.waits.append(h("li", {}));
    for (const [i, [kind, line]] of shown.entries()) {
      const row = this.waits.children[i]!;
      if (row.className !== kind) row.className = kind;
      if (row.textContent !== line) row.textContent = line;
    }
  }

  /** The rows that have changed; of many controllers, or long names, a row names those that take part, instead of a column for each. */
  private showVotes(): void {
    const controllers = [...new Set([...this.rows.values()].flatMap((row) => row.parts.map((part) => part.controller)))];
    const wide = (this.isWide ||= controllers.length > COLUMNS_MAX);
    const isNew = this.shownRows.size !== this.rows.size;
    if (isNew) {
      this.shownRows.clear();
      for (const name of this.rows.keys()) this.shownRows.set(name, h("tr", {}));
      const heads = wide ? [h("th", { scope: "col" }, "controllers")] : controllers.map((name) => h("th", { scope: "col" }, name));
      this.votes.replaceChildren(
        h("caption", { class: "unseen" }, "For each global transition, how each controller stands to it"),
        h("thead", {}, h("tr", {}, h("th", { scope: "col" }, ""), ...heads)),
        h("tbody", {}, ...this.shownRows.values()),
      );
      for (const name of this.rows.keys()) this.changedRows.add(name);
    }
    const marked = (vote: string): HTMLElement => {
      const [sign, words] = SIGNS[vote] ?? ["?", vote];
      return h("span", { class: `vote ${vote}`, title: words }, h("i", { "aria-hidden": "true" }, sign), h("span", { class: "unseen" }, words));
    };
    for (const name of this.changedRows) {
      const row = this.rows.get(name)!;
      const shown = this.shownRows.get(name)!;
      const of = new Map(row.parts.map((part) => [part.controller, part.vote]));
      const all = row.parts.every((part) => ["ready", "yes", "promised", "applied", "ordered"].includes(part.vote));
      shown.className = row.round || (all ? "all" : "");
      const cells = wide
        ? [h("td", { class: "parts" }, ...row.parts.flatMap((part) => [h("span", { class: "part" }, `${part.controller} `, marked(part.vote)), " "]))]
        : controllers.map((one) => h("td", {}, of.has(one) ? marked(of.get(one)!) : null));
      shown.replaceChildren(h("th", { scope: "row", title: row.says }, row.name, row.round ? h("span", { class: "soft" }, ` ${row.round}`) : null), ...cells);
    }
    this.changedRows.clear();
    if (!isNew || wide || this.votes.offsetWidth <= this.votes.parentElement!.clientWidth) return;
    this.isWide = true;
    this.shownRows.clear();
    this.showVotes();
  }

  /** The newest stand first, so nothing has to be measured and scrolled. */
  private showEvents(): void {
    const told = this.untold.splice(0).reverse();
    this.events.prepend(...told.map((event) => h("li", { class: event.kind }, h("span", { class: "soft" }, `${event.at.toFixed(1)} `), event.what)));
    while (this.events.children.length > EVENTS_SHOWN) this.events.lastElementChild!.remove();
  }

  private async command(path: string, words: string): Promise<void> {
    try {
      const answer = await ask<{ fired?: string | null; refused?: string[] }>(path, {});
      if (answer.refused?.length) {
        announce(`${words} is refused: ${answer.refused.join("; ")}.`);
        this.frame.hint.textContent = `${words} is refused: ${answer.refused.join("; ")}.`;
        return;
      }
      if (path === "step") announce(answer.fired ? `${answer.fired} has fired.` : "No transition has fired.");
      else announce(`${words}: done.`);
      if (path === "step" && !answer.fired) this.frame.hint.textContent = "No transition has fired.";
      else this.frame.hint.textContent = "";
    } catch (error) {
      const why = error instanceof Refused ? error.message : "the connection is lost";
      banner(this.frame.banner, "bad", `“${words}” did not reach the cell: ${why}. Use the controls at the machines.`);
    }
  }

  private end(now: Now): void {
    for (const one of this.buttons) one.disabled = true;
    document.body.classList.add("ended");
    const kind = BAD.has(now.state) ? "bad" : now.state === "done" ? "good" : "open";
    banner(this.frame.banner, kind, `The run has ended after ${counted(Math.round(now.at), "second")}: ${now.message ? `${now.state}, ${now.message}` : now.state}.`);
    announce(`The run has ended: ${now.state}.`);
  }
}
