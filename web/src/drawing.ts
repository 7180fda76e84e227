// The picture comes apart from the page: drawing a large net takes seconds, and meanwhile it is said what is being drawn,
// and all else is of use. With it comes which tasks can be folded, and the button that folds them.

import { announce, counted, h } from "./dom";
import { Picture, type Pressed } from "./picture";
import { ask, Refused, type Drawn, type Net } from "./server";

export class Drawing {
  readonly picture: Picture;
  readonly foldButton = h("button", {
    type: "button", hidden: true, "aria-pressed": "false", "aria-label": "Fold tasks", title: "Draw what a controller does for one task as one place, a double circle",
    click: () => void this.fold(this.folded.length > 0 ? [] : this.foldable),
  }, "Fold");
  private foldable: string[] = [];
  private folded: string[] = [];
  private asked = 0;

  constructor(private net: Net, private readonly pressing: Pressed) {
    this.picture = new Picture(net, { ...pressing, task: (name) => void this.fold(this.folded.filter((one) => one !== name)) });
  }

  /** Draw a net, this one or another, with these tasks folded; null leaves it to the command that serves. */
  async draw(net: Net, folded: string[] | null): Promise<boolean> {
    const mine = ++this.asked;
    this.net = net;
    const { picture } = this;
    picture.say(`Drawing ${net.name || "the net"}: ${counted(net.places.length, "place")} and ${counted(net.transitions.length, "transition")}…`);
    try {
      const drawn = await ask<Drawn>("api/picture", { folded });
      if (mine !== this.asked) return false;
      picture.draw(net, drawn);
      picture.say();
      this.foldable = drawn.foldable;
      this.folded = Object.keys(drawn.members);
      this.foldButton.hidden = this.pressing.place !== undefined || this.foldable.length === 0;
      this.foldButton.setAttribute("aria-pressed", String(this.folded.length > 0));
      return true;
    } catch (error) {
      if (mine !== this.asked) return false;
      const why = error instanceof Refused ? error.message : "the connection is lost";
      picture.say(`The net cannot be drawn: ${why}. `, h("button", { type: "button", click: () => void this.draw(this.net, folded) }, "Try again"));
      return false;
    }
  }

  private async fold(folded: string[]): Promise<void> {
    if (await this.draw(this.net, folded)) announce(folded.length > 0 ? `${counted(folded.length, "task")} folded.` : "No task is folded.");
  }
}
