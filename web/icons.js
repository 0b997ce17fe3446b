// The few signs of the page. State is always told by its shape and a word, never by colour alone.

import { s } from "./dom.js";

const PATHS = {
  pass: "M3 8.5 6.5 12 13 4.5",
  warn: "M8 2.5 14.5 13.5H1.5Z M8 6.5V9.5 M8 11.4V11.6",
  fail: "M4 4 12 12 M12 4 4 12",
  todo: "M8 2.5A5.5 5.5 0 1 1 7.99 2.5Z",
  skipped: "M4 8H12",
  working: "M8 2.5A5.5 5.5 0 1 1 7.99 2.5Z M8 2.5V13.5 M9.5 3.5V12.5 M11 4.5V11.5 M12.5 6V10",
  stale: "M13 5A5.5 5.5 0 1 0 13.5 9 M13.5 2V5.5H10",
  undo: "M6 3 2.5 6.5 6 10 M2.5 6.5H9.5A4 4 0 0 1 9.5 13.5H6",
  redo: "M10 3 13.5 6.5 10 10 M13.5 6.5H6.5A4 4 0 0 0 6.5 13.5H10",
  again: "M13 8A5 5 0 1 1 11.5 4.4 M11.5 1.8V4.6H8.7",
  rename: "M10.5 3 13 5.5 5.5 13H3V10.5Z M9 4.5 11.5 7",
  large: "M9.5 2.5H13.5V6.5 M13.5 2.5 9.5 6.5 M6.5 13.5H2.5V9.5 M2.5 13.5 6.5 9.5",
  archive: "M2.5 3H13.5V6H2.5Z M3.5 6V13.5H12.5V6 M6.5 8.5H9.5",
  trash: "M3 4.5H13 M6.5 4.5V2.5H9.5V4.5 M4.5 4.5 5 13.5H11L11.5 4.5",
  sun: "M8 5A3 3 0 1 1 7.99 5Z M8 1V2.5 M8 13.5V15 M1 8H2.5 M13.5 8H15 M3 3 4 4 M12 12 13 13 M13 3 12 4 M4 12 3 13",
  moon: "M12.5 10A5.5 5.5 0 0 1 6 3.5A5.5 5.5 0 1 0 12.5 10Z",
  copy: "M5.5 5.5H13V13.5H5.5Z M3 10.5V2.5H10.5",
  more: "M3.5 8H3.6 M8 8H8.1 M12.5 8H12.6",
  play: "M5 3.5 12.5 8 5 12.5Z",
  pause: "M5.5 3.5V12.5 M10.5 3.5V12.5",
  back: "M10 3.5 5.5 8 10 12.5",
  forward: "M6 3.5 10.5 8 6 12.5",
  close: "M4 4 12 12 M12 4 4 12",
};

/** @typedef {keyof typeof PATHS} IconName */

/** @param {IconName} name */
export function icon(name) {
  return s(
    "svg",
    { class: `icon icon-${name}`, viewBox: "0 0 16 16", width: 16, height: 16, "aria-hidden": "true" },
    s("path", { d: PATHS[name], fill: "none", stroke: "currentColor", "stroke-width": 1.75, "stroke-linecap": "round", "stroke-linejoin": "round" }),
  );
}

/**
 * A verdict as sign and word.
 * @param {string} verdict
 * @param {string} word
 */
export function mark(verdict, word) {
  const name = /** @type {IconName} */ (verdict in PATHS ? verdict : "todo");
  const element = document.createElement("span");
  element.className = `mark mark-${verdict}`;
  element.append(icon(name), word);
  return element;
}
