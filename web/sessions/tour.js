// A short tour: one card beside one part of the page at a time. Arrow keys walk it, Escape ends it; nothing moves by itself.

import { h } from "../dom.js";
import { t } from "../texts.js";

/** @typedef {{ at: string, text: import("../texts.js").Text }} Stop `at` is the selector of what the text is about */

const KEY = "scancell-visited";
const GAP = 12;

export const isFirstVisit = () => window.localStorage.getItem(KEY) === null;

export const noteVisit = () => window.localStorage.setItem(KEY, "1");

/** The parts of the session page, in the order of the work. @type {readonly Stop[]} */
export const SESSION_STOPS = [
  { at: "sc-guide", text: "tour.guide" },
  { at: "sc-actions", text: "tour.actions" },
  { at: "sc-scene", text: "tour.scene" },
  { at: "sc-rail", text: "tour.rail" },
  { at: ".tabs", text: "tour.result" },
];

/** @param {readonly Stop[]} stops */
export function tour(stops) {
  noteVisit();
  document.querySelector(".tour")?.remove();
  const before = document.activeElement;
  let index = 0;
  const count = h("p", { class: "soft small", id: "tour-count" });
  const words = h("p", { id: "tour-words" });
  const back = h("button", { type: "button", onclick: () => show(index - 1) }, t("tour.back"));
  const next = h("button", { type: "button", class: "primary", onclick: () => show(index + 1) });
  const card = h(
    "section", { class: "tour", role: "dialog", "aria-labelledby": "tour-count", "aria-describedby": "tour-words", onkeydown: (/** @type {KeyboardEvent} */ event) => key(event) },
    count, words, h("div", { class: "row spread" }, h("button", { type: "button", class: "plain", onclick: () => end() }, t("tour.skip")), h("span", { class: "row" }, back, next)),
  );

  const end = () => {
    card.remove();
    light(null);
    window.removeEventListener("resize", place);
    if (before instanceof HTMLElement && before.isConnected) before.focus();
  };
  /** @param {KeyboardEvent} event */
  const key = (event) => {
    if (event.key === "Escape") end();
    else if (event.key === "ArrowRight") show(index + 1);
    else if (event.key === "ArrowLeft") show(index - 1);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const place = () => {
    const stop = stops[index];
    const part = stop && document.querySelector(stop.at);
    if (part) beside(card, part.getBoundingClientRect());
  };
  /** @param {number} wanted */
  const show = (wanted) => {
    const stop = stops[wanted];
    if (wanted < 0) return;
    if (!stop) return end();
    index = wanted;
    count.textContent = t("tour.count", { number: index + 1, all: stops.length });
    words.textContent = t(stop.text);
    back.hidden = index === 0;
    next.textContent = t(index === stops.length - 1 ? "tour.end" : "tour.next");
    const part = document.querySelector(stop.at);
    light(part);
    part?.scrollIntoView({ block: "nearest" });
    place();
    next.focus();
  };

  document.body.append(card);
  window.addEventListener("resize", place);
  show(0);
}

/** @param {Element | null} part */
function light(part) {
  document.querySelector(".tour-lit")?.classList.remove("tour-lit");
  part?.classList.add("tour-lit");
}

/**
 * Below the part where there is room, otherwise above, otherwise over its middle; never beyond the window.
 * @param {HTMLElement} card
 * @param {DOMRect} part
 */
function beside(card, part) {
  const { offsetWidth: width, offsetHeight: height } = card;
  const right = window.innerWidth - width - GAP;
  const bottom = window.innerHeight - height - GAP;
  const below = part.bottom + GAP, above = part.top - GAP - height;
  const top = below <= bottom ? below : above >= GAP ? above : (part.top + part.bottom - height) / 2;
  card.style.left = `${Math.max(GAP, Math.min(part.left + GAP, right))}px`;
  card.style.top = `${Math.max(GAP, Math.min(top, bottom))}px`;
}
