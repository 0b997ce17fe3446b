// Terms that stand in labels, explained where the pointer or the focus rests on them, and where a finger touches them.

import { h } from "../dom.js";
import { t } from "../texts.js";

const TERMS = /** @type {const} */ (["zone", "k", "left", "rms"]).map((term) => /** @type {const} */ ([t(`glossary.term_${term}`), t(`glossary.words_${term}`)]));
const EDGE_PX = 8;

/** One for all; above dialogs too. */
const note = h("div", { class: "glossary", popover: "manual", "aria-hidden": "true" });
/** @type {HTMLElement | null} */
let term = null;

function hide() {
  if (note.isConnected) note.hidePopover();
  term = null;
}

/** A label with the first term in it explained. @param {string} label */
export function glossed(label) {
  const found = TERMS.find(([term]) => label.includes(term));
  if (!found) return label;
  const [named, words] = found;
  const [before, after] = [label.slice(0, label.indexOf(named)), label.slice(label.indexOf(named) + named.length)];
  const show = () => explain(explained, words);
  const explained = h("abbr", { class: "term", tabindex: 0, "aria-description": words, onpointerenter: show, onclick: show, onfocus: show, onpointerleave: hide, onblur: hide,
    onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Escape" && hide() }, named);
  return h("span", {}, before, explained, after);
}

/** @param {HTMLElement} one @param {string} words */
function explain(one, words) {
  term = one;
  note.textContent = words;
  if (!note.isConnected) document.body.append(note);
  note.showPopover();
  place();
}

function place() {
  if (!term) return;
  const { left, top, bottom } = term.getBoundingClientRect();
  const below = bottom + EDGE_PX + note.offsetHeight <= window.innerHeight;
  note.style.left = `${Math.max(EDGE_PX, Math.min(left, window.innerWidth - note.offsetWidth - EDGE_PX))}px`;
  note.style.top = `${below ? bottom + EDGE_PX / 2 : top - note.offsetHeight - EDGE_PX / 2}px`;
}

// Keys bring a term into sight: its note goes along.
window.addEventListener("scroll", () => (term === document.activeElement ? place() : hide()), { capture: true, passive: true });
