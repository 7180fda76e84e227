// The picture comes apart from the page: drawing a large net takes seconds, and meanwhile it is said what is being drawn,
// and all else is of use. With it comes what can be opened of the net, and folded, and the buttons that do so: the whole
// net, some of its controllers, or none, which is the overview.

import { announce, counted, h } from "./dom";
import { Picture, type Pressed } from "./picture";
import { ask, Refused, type Drawn, type Net, type Owner } from "./server";

/** What is drawn of a net: all of it, whoever owns something by now, or some controllers; none of them is the overview. */
type Opened = "whole" | Owner[];

const KEPT = "firable-opened";

/** What nobody owns is drawn as if it were of a controller. */
export const called = (owner: Owner): string => owner ?? "no controller";

export class Drawing {
  readonly picture: Picture;
  readonly overviewButton = h("button", { type: "button", hidden: true, title: "The controllers, and the transitions that they share", click: () => void this.open([]) }, "Overview");
  readonly wholeButton = h("button", { type: "button", hidden: true, title: "All controllers, with all of their places", click: () => void this.open("whole") }, "Whole net");
  readonly foldButton = h("button", {
    type: "button", hidden: true, "aria-pressed": "false", "aria-label": "Fold tasks", title: "Draw what a controller does for one task as one place, a double circle",
    click: () => void this.fold(this.folded.length > 0 ? [] : this.foldable),
  }, "Fold");
  /** The controllers that are opened, and those that can be. */
  readonly openedBar = h("div", { class: "opened", role: "group", "aria-label": "Controllers that are drawn", hidden: true });
  /** Those that can be opened; none where there is no overview. */
  owners: Owner[] = [];
  private opened: Opened | null;
  private foldable: string[] = [];
  private folded: string[] = [];
  private asked = 0;

  constructor(private net: Net, private readonly pressing: Pressed) {
    this.picture = new Picture(net, {
      ...pressing,
      task: (name) => void this.fold(this.folded.filter((one) => one !== name)),
      controller: (name) => void this.open([name]),
    });
    this.opened = kept(net);
  }

  /** Draw a net, this one or another, with these tasks folded; null leaves it to the command that serves. */
  draw(net: Net, folded: string[] | null): Promise<boolean> {
    this.net = net;
    return this.drawn(this.opened && ofNet(net, this.opened), folded, true);
  }

  /** With `elseAtFirst`, where this can no longer be drawn, what the server draws at first. */
  private async drawn(opened: Opened | null, folded: string[] | null, elseAtFirst = false): Promise<boolean> {
    const mine = ++this.asked;
    const { net, picture } = this;
    picture.say(`Drawing ${net.name || "the net"}: ${counted(net.places.length, "place")} and ${counted(net.transitions.length, "transition")}…`);
    try {
      const drawn = await ask<Drawn>("api/picture", { folded, opened: opened === "whole" ? everybody(net) : opened });
      if (mine !== this.asked) return false;
      const now = drawn.opened.length === everybody(net).length ? "whole" : drawn.opened;
      picture.draw(net, drawn, !picture.isDrawn || String(now) !== String(this.opened));
      this.opened = now;
      this.owners = drawn.owners;
      picture.say();
      this.foldable = drawn.foldable;
      this.folded = Object.keys(drawn.members);
      this.foldButton.hidden = this.pressing.place !== undefined || this.foldable.length === 0;
      this.foldButton.setAttribute("aria-pressed", String(this.folded.length > 0));
      this.showOpened(drawn);
      sessionStorage.setItem(KEPT, JSON.stringify({ net: net.name, opened: now }));
      return true;
    } catch (error) {
      if (mine !== this.asked) return false;
      if (!(error instanceof Refused)) {
        picture.say("The net cannot be drawn: the connection is lost. ", h("button", { type: "button", click: () => void this.drawn(opened, folded, elseAtFirst) }, "Try again"));
      } else if (elseAtFirst && opened !== null) {
        return this.drawn(null, folded);
      } else {
        const why = error.problems.map((one) => `${one.message}: ${one.hint}`).join("; ") || error.message;
        picture.say(`This cannot be drawn: ${why}. `, h("button", { type: "button", click: () => picture.say() }, "Close"));
      }
      return false;
    }
  }

  private async fold(folded: string[]): Promise<void> {
    if (await this.drawn(this.opened, folded)) announce(folded.length > 0 ? `${counted(folded.length, "task")} folded.` : "No task is folded.");
  }

  async open(opened: Opened): Promise<void> {
    const words = opened === "whole" ? "The whole net." : opened.length > 0 ? `Drawn: ${opened.map(called).join(", ")}.` : "The overview.";
    if (await this.drawn(opened, this.folded)) announce(words);
  }

  /** Open the controller of a place or transition that is not drawn. */
  bringIn(kind: string, name: string): void {
    const { opened, net } = this;
    if (opened === null || opened === "whole") return;
    const places = net.places.filter((one) => kind === "place" && one.name === name).map((one) => one.owner);
    const owners = [...places, ...net.transitions.filter((one) => kind === "transition" && one.name === name).flatMap((one) => one.owners)];
    const isShared = opened.length === 0 && owners.length > 1;
    if (owners.length > 0 && !isShared && !owners.some((owner) => opened.includes(owner))) void this.open([...opened, owners[0]!]);
  }

  private showOpened({ opened, owners, whole }: Drawn): void {
    const isWhole = this.opened === "whole";
    const hadFocus = this.openedBar.contains(document.activeElement);
    this.overviewButton.hidden = owners.length === 0 || opened.length === 0;
    this.wholeButton.hidden = owners.length === 0 || isWhole || !whole;
    this.openedBar.hidden = owners.length === 0 || isWhole;
    const beside = new Set(this.net.transitions.filter((one) => one.owners.some((owner) => opened.includes(owner))).flatMap((one) => one.owners));
    const closed = owners.filter((owner) => !opened.includes(owner));
    const option = (owner: Owner): HTMLElement => h("option", { value: String(owners.indexOf(owner)) }, called(owner));
    const group = (label: string, some: Owner[]): HTMLElement | null => (some.length > 0 ? h("optgroup", { label }, ...some.map(option)) : null);
    const choice = h("select", { "aria-label": "Open a controller", change: () => void this.open([...opened, owners[Number(choice.value)]!]) },
      h("option", { value: "", disabled: true, selected: true }, opened.length > 0 ? "Open with…" : "Open…"),
      group("share transitions", closed.filter((owner) => beside.has(owner))), group("others", closed.filter((owner) => !beside.has(owner))));
    this.openedBar.replaceChildren(
      ...opened.map((owner) => h("button", { type: "button", class: "small", "aria-label": `Close ${called(owner)}`, title: "Close", click: () => void this.open(opened.filter((one) => one !== owner)) }, `${called(owner)} ×`)),
      choice,
    );
    if (hadFocus) choice.focus();
  }
}

/** What was opened of a net before the window was loaded again. */
function kept(net: Net): Opened | null {
  const { net: name, opened } = JSON.parse(sessionStorage.getItem(KEPT) ?? "{}") as { net?: string; opened?: Opened };
  return name === net.name && opened ? ofNet(net, opened) : null;
}

/** All who own something of a net. */
const everybody = (net: Net): Owner[] => [...new Set([...net.places, ...net.signals].map(({ owner }) => owner))];

/** What a net has of that; nothing if all are gone. */
function ofNet(net: Net, opened: Opened): Opened | null {
  if (opened === "whole") return opened;
  const there = opened.filter((owner) => owner === null || net.controllers.includes(owner));
  return there.length === 0 && opened.length > 0 ? null : there;
}
