// The beginning: who are we, and what is it that is shown here?

import { h } from "./dom";
import { Edit } from "./edit";
import { banner } from "./frame";
import { Live, type LiveStart } from "./live";
import { Play } from "./play";
import { ask, keepToken, Refused, token, type Edited, type EditState, type PlayPage } from "./server";
import "./style.css";

async function begin(): Promise<void> {
  try {
    const page = await ask<PlayPage | LiveStart>("api/page");
    if (page.mode === "live") new Live(page);
    else play(page);
  } catch (error) {
    if (error instanceof Refused && error.status === 401) return askForToken(token() !== "");
    const words = error instanceof Refused ? error.message : "The server does not answer: has the command ended?";
    message("This page cannot be shown", h("p", { role: "alert" }, words));
  }
}

function play(page: PlayPage): Play {
  return new Play(page, {
    edit: (state) => void (state.shown === page.shown && state.is_net ? edit(page, state) : reload(page)),
    reload: () => void reload(page),
    cured: (edited, words) => play(edited.page).written(edited.edit, words),
    mend: (state, draft) => edit(page, state).refuse(draft),
  });
}

function edit(page: PlayPage, state: EditState): Edit {
  return new Edit(page, state, () => void begin());
}

/** The file has changed on the disk: play what it holds now, or mend it. */
async function reload(page: PlayPage): Promise<void> {
  try {
    const now = await ask<Edited>("api/edit/reload", {});
    if ("page" in now) return void play(now.page);
    const state = { text: now.draft, version: now.version ?? "", is_net: false, shown: page.shown, undo: null, redo: null, arcs: {}, marked: [] };
    edit(page, state).refuse(now);
  } catch (error) {
    const words = error instanceof Refused ? error.message : "the connection is lost";
    banner(document.querySelector<HTMLElement>(".banners")!, "bad", `${page.file}: ${words}.`);
  }
}

function message(title: string, ...children: (Node | null)[]): void {
  document.getElementById("page")!.replaceChildren(h("main", { class: "alone" }, h("h1", {}, title), ...children));
}

function askForToken(isWrong: boolean): void {
  const field = h("input", { id: "token", type: "password", autocomplete: "off", required: true });
  const form = h("form", {
    submit: (event: Event) => {
      event.preventDefault();
      keepToken(field.value.trim());
      void begin();
    },
  }, h("label", { for: "token" }, "Token"), field, h("button", {}, "Go on"));
  message("Who are you?", isWrong ? h("p", { role: "alert" }, "The token of this window is not that of the command that runs now.") : null,
    h("p", {}, "Open the address that the command has printed, or enter the token of this run."), form);
  field.focus();
}

void begin();
