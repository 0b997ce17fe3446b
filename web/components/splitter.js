// The border between work and scene: dragged, moved by the arrow keys, and kept as it was left.

import { h } from "../dom.js";
import { t } from "../texts.js";

const KEY = "scancell-scene-share";
const [LEAST, MOST, USUAL, STEP] = [20, 70, 35, 3];

/** @param {HTMLElement} session whose last column is the scene */
export function splitter(session) {
  let share = Number(window.localStorage.getItem(KEY)) || USUAL;
  const bar = h("div", {
    class: "splitter", role: "separator", tabindex: 0, "aria-orientation": "vertical", "aria-label": t("scene.width"), "aria-valuemin": LEAST, "aria-valuemax": MOST,
    onkeydown: (/** @type {KeyboardEvent} */ event) => {
      const next = { ArrowLeft: share + STEP, ArrowRight: share - STEP, Home: LEAST, End: MOST }[event.key];
      if (next === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      set(next, true);
    },
    ondblclick: () => set(USUAL, true),
    onpointerdown: (/** @type {PointerEvent} */ event) => {
      bar.setPointerCapture(event.pointerId);
      session.classList.add("splitting");
    },
    onpointermove: (/** @type {PointerEvent} */ event) => {
      if (!bar.hasPointerCapture(event.pointerId)) return;
      const box = session.getBoundingClientRect();
      set((100 * (box.right - event.clientX)) / box.width, false);
    },
    onlostpointercapture: () => {
      session.classList.remove("splitting");
      set(share, true);
    },
  });
  /** @param {number} wanted @param {boolean} keep */
  function set(wanted, keep) {
    share = Math.round(Math.min(MOST, Math.max(LEAST, wanted)));
    session.style.setProperty("--scene", `${share}%`);
    bar.setAttribute("aria-valuenow", String(share));
    if (keep) window.localStorage.setItem(KEY, String(share));
  }
  set(share, false);
  return bar;
}
