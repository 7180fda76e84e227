// The beginning: who are we, and what is it that is shown here?

import { h } from "./dom";
import { Live, type LiveStart } from "./live";
import { Play } from "./play";
import { ask, keepToken, Refused, type PlayPage } from "./server";
import "./style.css";

async function begin(): Promise<void> {
  try {
    const page = await ask<PlayPage | LiveStart>("api/page");
    if (page.mode === "live") new Live(page);
    else new Play(page);
  } catch (error) {
    if (error instanceof Refused && error.status === 401) return askForToken();
    const words = error instanceof Refused ? error.message : "The server does not answer: has the command ended?";
    message("This page cannot be shown", h("p", { role: "alert" }, words));
  }
}

function message(title: string, ...children: Node[]): void {
  document.getElementById("page")!.replaceChildren(h("main", { class: "alone" }, h("h1", {}, title), ...children));
}

function askForToken(): void {
  const field = h("input", { id: "token", type: "password", autocomplete: "off", required: true });
  const form = h("form", {
    submit: (event: Event) => {
      event.preventDefault();
      keepToken(field.value.trim());
      void begin();
    },
  }, h("label", { for: "token" }, "Token"), field, h("button", {}, "Go on"));
  message("Who are you?", h("p", {}, "Open the address that the command has printed, or enter the token of this run."), form);
  field.focus();
}

void begin();
