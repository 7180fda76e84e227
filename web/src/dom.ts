// Making elements: the one helper by which the page writes itself. Text goes in as text, so no name of a net is markup.

type Child = Node | string | null | undefined | false;
type Value = string | number | boolean | ((event: never) => void) | null | undefined;

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, Value> = {},
  ...children: (Child | Child[])[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value as EventListener);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, String(value));
  }
  for (const child of children.flat()) if (child) element.append(child);
  return element;
}

export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Record<string, string | number> = {},
): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

/** Say something to whoever listens to the page instead of seeing it. */
export function announce(words: string): void {
  const region = document.getElementById("said");
  if (region !== null) region.textContent = words;
}

/** Whether Ctrl+Z there is about what is being typed, and not about what was done on the page. */
export function isTyping(where: EventTarget | null): boolean {
  if (where instanceof HTMLInputElement) return where.type === "text" && where.value !== where.defaultValue;
  return where instanceof HTMLTextAreaElement;
}

export const counted = (n: number, word: string): string => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : "s"}`;

export const calm = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Draw when it is wanted, but never for more than a tenth of the time: what is large is drawn seldom, and nothing waits for it. */
export function paced(draw: () => void): () => void {
  let waiting = false;
  let free = 0;
  const drawn = (): void => {
    waiting = false;
    const begin = performance.now();
    draw();
    setTimeout(() => (free = performance.now() + 9 * (performance.now() - begin))); // with the browser's own share
  };
  return () => {
    if (waiting) return;
    waiting = true;
    setTimeout(() => requestAnimationFrame(drawn), Math.max(0, free - performance.now()));
  };
}
