// The frame of the page: its head, the picture with its tools, and the panels beside it; the same when one plays and
// when a cell runs.

import { h } from "./dom";
import type { Drawing } from "./drawing";
import type { Picture } from "./picture";
import { ask } from "./server";
import type { TopView } from "./top_view";

export interface Frame {
  tools: HTMLElement;
  below: HTMLElement;
  side: HTMLElement;
  status: HTMLElement;
  banner: HTMLElement;
  /** A sentence that stands over the picture. */
  hint: HTMLElement;
  /** Over when another frame takes the place of this one. */
  gone: AbortSignal;
}

let shown = new AbortController();

/** The net and the cell from above, as two tabs of one place. */
function tabs(picture: Picture, top: TopView, zoom: HTMLElement): HTMLElement {
  const panels = [picture.element, top.element];
  const made = [["net", "The net"], ["top", "Top view"]].map(([id, words], i) =>
    h("button", { type: "button", role: "tab", id: `tab-${id}`, "aria-controls": id!, "aria-selected": String(i === 0), tabindex: i === 0 ? 0 : -1, click: () => choose(i) }, words!));
  const choose = (chosen: number): void => {
    made.forEach((one, i) => {
      one.setAttribute("aria-selected", String(i === chosen));
      one.tabIndex = i === chosen ? 0 : -1;
      panels[i]!.hidden = i !== chosen;
    });
    zoom.hidden = chosen !== 0; // which is of the picture of the net
    made[chosen]!.focus();
    if (chosen === 0) picture.fit();
  };
  const row = h("div", { class: "tabs", role: "tablist", "aria-label": "What is shown", keydown: (event: KeyboardEvent) => {
    const at = made.indexOf(event.target as HTMLButtonElement);
    if (at < 0 || !["ArrowLeft", "ArrowRight"].includes(event.key)) return;
    event.preventDefault();
    choose(1 - at);
  } }, ...made);
  return row;
}

export function frame(title: string, says: string, kind: string, drawing: Drawing, top?: TopView): Frame {
  const { picture } = drawing;
  shown.abort();
  shown = new AbortController();
  const gone = shown.signal;
  const tools = h("div", { class: "tools", role: "toolbar", "aria-label": kind });
  const below = h("div", { class: "below" });
  const side = h("aside", { "aria-label": "Details" });
  const status = h("p", { class: "status" });
  const banner = h("div", { class: "banners" });
  const hint = h("p", { class: "hint" });
  const zoom = h(
    "div",
    { class: "zoom", role: "group", "aria-label": "How the picture is shown" },
    h("button", { type: "button", "aria-label": "Smaller", click: () => picture.zoom(1 / 1.25) }, "−"),
    h("button", { type: "button", click: () => picture.fit() }, "Fit"),
    h("button", { type: "button", "aria-label": "Larger", click: () => picture.zoom(1.25) }, "+"),
    drawing.openedBar,
    drawing.overviewButton,
    drawing.wholeButton,
    drawing.foldButton,
  );
  document.title = `${title} – firable`;
  document.getElementById("page")!.replaceChildren(
    h(
      "header",
      {},
      h("div", { class: "names" }, h("h1", {}, title), says ? h("p", {}, says) : null),
      status,
    ),
    banner,
    h(
      "main",
      {},
      h("section", { class: "stage", "aria-label": "The cell" }, h("div", { class: "bar-above" }, tools, top ? tabs(picture, top, zoom) : null, zoom), picture.element, top?.element, hint, below),
      side,
    ),
    h("p", { id: "said", class: "unseen", role: "status", "aria-live": "polite" }),
  );
  picture.element.tabIndex = 0;
  picture.element.id = "net";
  picture.element.setAttribute("role", top ? "tabpanel" : "region");
  picture.element.setAttribute("aria-label", "Picture of the net; scrolls");
  let width = innerWidth;
  addEventListener("resize", () => {
    if (innerWidth !== width) picture.fit();
    width = innerWidth;
  }, { signal: gone });
  return { tools, below, side, status, banner, hint, gone };
}

/** Look every two seconds whether the file, and the net that the server has of it, are still what is shown; say where not. */
export function watchFile(where: Frame, shown: () => number, isNet: () => boolean, reload: () => void): void {
  const timer = setInterval(() => {
    if (document.hidden || where.banner.querySelector(".reload") !== null) return;
    const before = shown();
    ask<{ current: boolean; shown: number; is_net: boolean }>("api/edit/version").then((now) => {
      // While this window waits for an edit of its own, the server may have it already.
      if ((now.current && now.shown === before && now.is_net === isNet()) || before !== shown() || where.gone.aborted) return;
      const edited = now.is_net ? "The net has been edited in another window." : "The file is no net as it stands on the disk.";
      const words = now.current ? edited : "The file has been changed on the disk.";
      banner(where.banner, "open", words, h("button", { type: "button", class: "reload", click: reload }, "Load it again"));
    }, () => undefined); // that nobody answers is told by what one does
  }, 2000);
  where.gone.addEventListener("abort", () => clearInterval(timer));
}

/** A panel with a heading, which folds. */
export function panel(title: string, ...children: (Node | null)[]): HTMLDetailsElement {
  return h("details", { class: "panel", open: true }, h("summary", {}, h("h2", {}, title)), h("div", { class: "inside" }, ...children));
}

/** A banner across the page; an alarm is said at once. */
export function banner(where: HTMLElement, kind: "bad" | "open" | "good", words: string, ...more: (Node | string)[]): HTMLElement {
  const made = h("div", { class: `banner ${kind}`, role: kind === "bad" ? "alert" : "status" }, h("span", {}, words), ...more);
  where.replaceChildren(made);
  return made;
}
