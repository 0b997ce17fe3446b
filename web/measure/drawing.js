// One of the page's own drawings, put into the document so that it wears the theme's colours.

import { request } from "../state/http.js";

const FALLBACK = "cell";
/** @type {Map<string, Promise<string>>} */
const known = new Map();

/** @param {string} name */
function load(name) {
  let text = known.get(name);
  if (!text) {
    const { pathname } = new URL(`../drawings/${encodeURIComponent(name)}.svg`, import.meta.url);
    text = request(pathname, {}, "").then((response) => response.text());
    known.set(name, text);
    text.catch(() => known.delete(name));
  }
  return text;
}

export class DrawingElement extends HTMLElement {
  static names = new Set([
    "cell", "files", "rest", "tcp-first", "tcp-shift", "tcp-turn", "tcp-solve", "tcp-done",
    "ball-first", "ball-shift", "ball-turn", "ball-done",
    "turntable-first", "turntable-turn", "turntable-height", "turntable-solve", "turntable-done", "slide", "chain-solve",
    "scan-first", "scan-around", "merge-solve", "merge-done",
    "board-views", "board-stripe", "board-solve",
  ]);
  #shown = "";

  /** @param {string} name */
  set name(name) {
    const chosen = DrawingElement.names.has(name) ? name : FALLBACK;
    if (chosen === this.#shown) return;
    this.#shown = chosen;
    this.setAttribute("aria-hidden", "true");
    void load(chosen).then((text) => {
      if (this.#shown !== chosen) return;
      const parsed = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
      parsed.removeAttribute("role");
      this.replaceChildren(document.importNode(parsed, true));
    }, () => { this.#shown = ""; });
  }
}

customElements.define("sc-drawing", DrawingElement);
