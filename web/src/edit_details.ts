// What is chosen, and what can be done to it; and what can be added. Everything that a click in the picture does is here
// too, by names, for who works by the keyboard.

import { h } from "./dom";
import { PARTS, type EditState, type Net, type Part } from "./server";

export type Kind = "controller" | "place" | "transition" | "signal";

export interface Chosen {
  kind: Kind;
  name: string;
}

/** An edit, as the server knows it; `then` is chosen once it is done, and `done` called. */
export type Doing = { do: string; then?: Chosen; done?: () => void } & Record<string, unknown>;

const PART_WORDS: Record<Part, string> = { from: "Takes from", to: "Puts to", if: "Gate if", unless: "Gate unless" };
const NOBODY = "(nobody)";

export class Details {
  readonly chosenPanel = h("div", { class: "form" });
  readonly addPanel = h("div", { class: "form" });
  chosen: Chosen | null = null;
  private net!: Net;
  private state!: EditState;

  constructor(
    private readonly does: (what: Doing) => void,
    private readonly choose: (chosen: Chosen | null) => void,
  ) {}

  show(net: Net, state: EditState): void {
    this.net = net;
    this.state = state;
    if (this.chosen && !this.names(this.chosen.kind).includes(this.chosen.name)) this.chosen = null;
    const key = (document.activeElement as HTMLElement | null)?.dataset["key"];
    this.chosenPanel.replaceChildren(this.chooser(), ...(this.chosen ? this.form(this.chosen) : [h("p", { class: "soft" }, "Choose a place, a transition, a signal or a controller, here or in the picture.")]));
    this.showAdd();
    if (key) [...this.chosenPanel.querySelectorAll<HTMLElement>("[data-key]"), ...this.addPanel.querySelectorAll<HTMLElement>("[data-key]")].find((one) => one.dataset["key"] === key)?.focus();
  }

  private names(kind: Kind): string[] {
    const { net } = this;
    return kind === "controller" ? net.controllers : (kind === "place" ? net.places : kind === "signal" ? net.signals : net.transitions).map((one) => one.name);
  }

  private field(label: string, control: HTMLElement, ...more: (HTMLElement | null)[]): HTMLElement {
    return h("label", { class: "field" }, h("span", {}, label), h("span", { class: "row" }, control, ...more));
  }

  private options(names: string[], chosen: string | null): HTMLOptionElement[] {
    return names.map((name) => h("option", { value: name, selected: name === chosen }, name));
  }

  private chooser(): HTMLElement {
    const value = (one: Chosen | null): string => (one ? `${one.kind}:${one.name}` : "");
    const groups = (["place", "transition", "signal", "controller"] as const).map((kind) =>
      h("optgroup", { label: `${kind}s` }, ...this.names(kind).map((name) => h("option", { value: `${kind}:${name}`, selected: value(this.chosen) === `${kind}:${name}` }, name))));
    const made = h("select", {
      "data-key": "chooser",
      change: () => {
        const [kind, ...rest] = made.value.split(":");
        this.choose(made.value ? { kind: kind as Kind, name: rest.join(":") } : null);
      },
    }, h("option", { value: "" }, "–"), ...groups.filter((one) => one.children.length > 0));
    return this.field("Chosen", made);
  }

  private form(chosen: Chosen): HTMLElement[] {
    const { kind, name } = chosen;
    const place = this.net.places.find((one) => one.name === name);
    const signal = this.net.signals.find((one) => one.name === name);
    const isGiven = kind === "transition" ? !(name in this.state.arcs) : kind === "signal" && signal?.kind !== "sensor";
    if (isGiven) {
      const why = kind === "transition" ? "It follows from the time limit of its place." : "It is named by `until` or `within` of its place.";
      return [h("p", { class: "soft" }, `${why} Edit it in the text.`), ...(kind === "signal" ? [this.renaming(chosen)] : [])];
    }
    const says = kind === "place" ? place?.says : kind === "transition" ? this.net.transitions.find((one) => one.name === name)?.says : undefined;
    const rows = [this.renaming(chosen)];
    if (kind === "place" || kind === "transition") rows.push(this.describing(chosen, says ?? ""));
    if (kind === "place" || kind === "signal") rows.push(this.owning(chosen, (kind === "place" ? place?.owner : signal?.owner) ?? null));
    if (kind === "place") rows.push(this.marking(name));
    if (kind === "place") rows.push(this.neighbours(name));
    if (kind === "transition") for (const part of PARTS) rows.push(this.part(name, part));
    rows.push(h("button", { type: "button", class: "danger", "data-key": "delete", click: () => this.does({ do: "delete", kind, name }) }, `Delete ${name}`));
    return rows;
  }

  /** A text that is sent by its button or by Enter. */
  private text(label: string, key: string, value: string, button: string, done: (value: string) => void): HTMLElement {
    const input = h("input", { value, "data-key": key, autocomplete: "off", spellcheck: "false" });
    return h("form", { submit: (event: Event) => { event.preventDefault(); done(input.value.trim()); } }, this.field(label, input, h("button", {}, button)));
  }

  private renaming({ kind, name }: Chosen): HTMLElement {
    const at = kind === "place" || kind === "signal" ? name.lastIndexOf(".") + 1 : 0;
    return this.text("Name", "name", name.slice(at), "Rename", (value) =>
      this.does({ do: "rename", kind, name, new: value, then: { kind, name: name.slice(0, at) + value } }));
  }

  private describing({ kind, name }: Chosen, says: string): HTMLElement {
    return this.text("Description", "says", says, "Set", (words) => this.does({ do: "describe", kind, name, words }));
  }

  private owner(key: string, owner: string | null): HTMLSelectElement {
    return h("select", { "data-key": key }, h("option", { value: "", selected: owner === null }, NOBODY), ...this.options(this.net.controllers, owner));
  }

  private owning({ kind, name }: Chosen, owner: string | null): HTMLElement {
    const made = this.owner("owner", owner);
    const local = name.slice(name.lastIndexOf(".") + 1);
    const give = (): void => {
      const to = made.value || null;
      this.does({ do: "own", kind, name, owner: to, then: { kind, name: to ? `${to}.${local}` : local } });
    };
    return this.field("Owner", made, h("button", { type: "button", "data-key": "own", click: give }, "Give"));
  }

  private marking(name: string): HTMLElement {
    const marked = this.state.marked.includes(name);
    const made = h("input", { type: "checkbox", checked: marked, "data-key": "marked", change: () => this.does({ do: "mark", name, marked: made.checked }) });
    return h("label", { class: "row" }, made, "a token at first");
  }

  /** The transitions that touch a place; a click chooses one. */
  private neighbours(name: string): HTMLElement {
    const found = Object.entries(this.state.arcs).flatMap(([transition, parts]) =>
      PARTS.filter((part) => parts[part].includes(name)).map((part) =>
        h("li", {}, h("button", { type: "button", class: "small", click: () => this.choose({ kind: "transition", name: transition }) }, transition), ` ${part}`)));
    return h("div", {}, h("h3", {}, "At the transitions"), found.length > 0 ? h("ul", { class: "list" }, ...found) : h("p", { class: "soft" }, "none"));
  }

  private part(transition: string, part: Part): HTMLElement {
    const now = this.state.arcs[transition]![part];
    const isGate = part === "if" || part === "unless";
    const others = [...this.names("place"), ...(isGate ? this.names("signal") : [])].filter((name) => !now.includes(name));
    const made = h("select", { "data-key": `add-${part}`, "aria-label": `${PART_WORDS[part]}: one more` }, h("option", { value: "" }, "–"), ...this.options(others, null));
    const more = h("button", { type: "button", "data-key": `more-${part}`, "aria-label": `${PART_WORDS[part]}: add`, click: () => made.value && this.does({ do: "connect", transition, part, name: made.value }) }, "Add");
    return h("div", { role: "group", "aria-label": PART_WORDS[part] }, h("h3", {}, PART_WORDS[part]),
      h("ul", { class: "list" }, ...now.map((name) =>
        h("li", { class: "row" }, h("code", {}, name), h("button", { type: "button", class: "small", "data-key": `less-${part}-${name}`, "aria-label": `${PART_WORDS[part]} ${name}: delete`, click: () => this.does({ do: "disconnect", transition, part, name }) }, "×")))),
      h("span", { class: "row" }, made, more));
  }

  private showAdd(): void {
    if (this.addPanel.childElementCount > 0) {
      const owner = this.addPanel.querySelector<HTMLSelectElement>("[data-key=add-owner]")!;
      owner.replaceWith(this.owner("add-owner", this.net.controllers.includes(owner.value) ? owner.value : null));
      return;
    }
    const kind = h("select", { "data-key": "add-kind" }, ...this.options(["place", "transition", "sensor", "controller"], "place"));
    const name = h("input", { "data-key": "add-name", autocomplete: "off", spellcheck: "false" });
    const owner = this.field("Owner", this.owner("add-owner", this.net.controllers[0] ?? null));
    kind.addEventListener("change", () => (owner.hidden = kind.value === "transition" || kind.value === "controller"));
    this.addPanel.append(h("form", {
      class: "form",
      submit: (event: Event) => {
        event.preventDefault();
        const own = owner.hidden ? null : owner.querySelector("select")!.value || null;
        const made = kind.value === "sensor" ? "signal" : (kind.value as Kind);
        const local = name.value.trim();
        this.does({ do: "add", kind: made, name: local, owner: own, then: { kind: made, name: own ? `${own}.${local}` : local }, done: () => (name.value = "") });
      },
    }, this.field("What", kind), this.field("Name", name), owner, h("button", {}, "Add")));
  }
}
