// What the server is asked, and how it knows who asks: by the token in the fragment of the address that the command
// printed. The fragment is sent to nobody; it is taken out of the address bar, and kept for a reload of this window.

import type { Scene, Top, TopStart } from "./top_view";

export interface Wait {
  may: "fire" | "wait" | "not";
  why?: string;
  empty?: string[];
  full?: string[];
  closed?: string[];
  /** Whether a token that it would take is there. */
  near?: boolean;
}

export interface Moment {
  marking: string[];
  signals: string[];
  free: boolean;
  transitions: Record<string, Wait>;
  deadlock: boolean;
  /** In a deadlock: who waits for whom. */
  circle?: string[];
  /** How the cell looks, where a plant says what it is made of. */
  top?: Top;
}

/** A moment as the server is told it. */
export interface At {
  marking: string[];
  signals: string[];
  free: boolean;
  scene?: Scene | undefined;
}

export interface Fired extends Moment {
  fired: string[];
  sent: string[];
}

export interface Place {
  name: string;
  says: string;
  owner: string | null;
  machine: string | null;
  command: string | null;
  completion: string | null;
}

export interface Signal {
  name: string;
  owner: string | null;
  kind: "completion" | "sensor" | "timer";
  gates: string[];
}

/** A controller, or null for what nobody owns. */
export type Owner = string | null;

export interface Net {
  name: string;
  description: string;
  controllers: string[];
  places: Place[];
  transitions: { name: string; says: string; owners: Owner[] }[];
  signals: Signal[];
}

/** The picture of a net, its folded tasks with the places inside them, what can be folded, and what is opened and can be. */
export interface Drawn {
  picture: string;
  members: Record<string, string[]>;
  foldable: string[];
  /** The controllers that are drawn; none in an overview. */
  opened: Owner[];
  /** Those that can be opened, where the net has an overview. */
  owners: Owner[];
  /** Whether all can be opened at once. */
  whole: boolean;
}

export interface RunSummary {
  name: string;
  says: string;
  firings: number;
}

export interface Frame {
  at?: number | null;
  marking: string[];
  signals: string[];
  what: string;
  says?: string;
  fired?: string[];
  turn?: boolean;
  /** How the cell looks from here on, where that has changed. */
  scene?: Scene;
}

export interface Run extends RunSummary {
  note: string;
  free: boolean;
  frames: Frame[];
  left_out: number;
}

export interface Verdict {
  name: string;
  /** How it ended, as `firable check` tells it: also whether as the file expects. */
  sign: string;
  word: string;
  tone: "good" | "bad" | "open" | null;
  /** Whether it fails the whole. */
  fails: boolean;
  listed: boolean;
  says: string;
  /** The places or transitions that violate it, the first of many. */
  about: string;
  /** What to write instead, where something is not as it should be. */
  hints: { code: string; says: string }[];
  /** Changes that make it hold, each with what checking the changed net has shown. */
  cures: { changes: string[]; checked: string }[];
}

export interface PlayPage {
  mode: "play";
  file: string;
  editable: boolean;
  /** Which of the nets that the file has held since the command began. */
  shown: number;
  net: Net;
  moment: Moment;
  runs: RunSummary[];
  verdicts: Verdict[] | null;
  top: TopStart;
}

export interface Problem {
  code: string;
  message: string;
  hint: string;
  line: number | null;
  column: number | null;
  length: number | null;
}

export const PARTS = ["from", "to", "if", "unless"] as const;
export type Part = (typeof PARTS)[number];

/** The file that is edited, or why none is. */
export interface EditState {
  why_not?: string;
  text: string;
  version: string;
  /** Whether the text is a net: the one that is shown. */
  is_net: boolean;
  shown: number;
  undo: string | null;
  redo: string | null;
  arcs: Record<string, Record<Part, string[]>>;
  marked: string[];
}

/** The net with an edit. */
export interface Written {
  page: PlayPage;
  edit: EditState;
}

/** A text that is no net and was not written; with a version it is the file itself, which somebody else has written so. */
export interface Draft {
  errors: Problem[];
  draft: string;
  version: string | null;
}

/** What came of an edit. */
export type Edited = Written | Draft;

/** An answer that is a refusal, in the server's words. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    readonly problems: Problem[],
  ) {
    const unknown = "the command has been started anew and does not know this window: open the address that it has printed";
    super(problems.map((one) => one.message).join("; ") || (status === 401 ? unknown : `the server answers ${status}`));
  }
}

const KEPT = "firable-token";

export function token(): string {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given !== null) {
    sessionStorage.setItem(KEPT, given);
    history.replaceState(null, "", location.pathname);
  }
  return given ?? sessionStorage.getItem(KEPT) ?? "";
}

export function keepToken(given: string): void {
  sessionStorage.setItem(KEPT, given);
}

function headers(): HeadersInit {
  const shown = token();
  return shown === "" ? {} : { Authorization: `Bearer ${shown}` };
}

export async function ask<T>(path: string, body?: unknown): Promise<T> {
  const asked: RequestInit = { headers: headers(), cache: "no-store" };
  if (body !== undefined) Object.assign(asked, { method: "POST", body: JSON.stringify(body) });
  const answer = await fetch(path, asked);
  const data: unknown = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(answer.status, (data as { errors?: Problem[] }).errors ?? []);
  return data as T;
}

/** The lines of JSON that the server tells as they come; ends when the server ends, throws when the connection does. */
export async function* follow<T>(path: string, stop: AbortSignal): AsyncGenerator<T> {
  const answer = await fetch(path, { headers: headers(), cache: "no-store", signal: stop });
  if (!answer.ok || answer.body === null) throw new Refused(answer.status, []);
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const lines = (rest + value).split("\n");
    rest = lines.pop() ?? "";
    for (const line of lines) if (line !== "") yield JSON.parse(line) as T;
  }
}
