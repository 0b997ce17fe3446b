// What can be taken back, the newest first. Each deed asks the server for its opposite, so that everybody sees it.

import { Problem } from "./api.js";
import { attempt, notify, say } from "./components/toasts.js";
import { t } from "./texts.js";

/** @typedef {{ text: string, back: () => Promise<unknown>, close?: () => void }} Deed */

const MOST = 50;
/** @type {Deed[]} */
let deeds = [];
const changes = new EventTarget();
const changed = () => void changes.dispatchEvent(new Event("change"));

/**
 * Note something that was done and how to take it back; `tell` shows it as a notice, too.
 * @param {string} text
 * @param {() => Promise<unknown>} back
 * @param {{ tell?: boolean }} [options]
 */
export function did(text, back, { tell = false } = {}) {
  /** @type {Deed} */
  const deed = { text, back };
  deeds = [...deeds, deed].slice(-MOST);
  if (tell) deed.close = notify(text, { undo: () => takeBack(deed) });
  changed();
}

/** @param {Deed} deed */
async function takeBack(deed) {
  const place = deeds.indexOf(deed);
  if (place < 0) return;
  deeds = deeds.filter((one) => one !== deed);
  deed.close?.();
  changed();
  try {
    await deed.back();
    say(t("undo.done", { what: deed.text }));
  } catch (error) {
    // Where the server was away it can be tried again; what it refused will not come right by itself.
    if (error instanceof Problem && error.status === 0) {
      deeds.splice(place, 0, deed);
      changed();
    }
    throw error;
  }
}

export async function undoLast() {
  const deed = deeds.at(-1);
  if (deed) await attempt(() => takeBack(deed));
  else say(t("undo.nothing"));
}

/** What would be taken back next. */
export const lastDeed = () => deeds.at(-1)?.text ?? null;

/** Another session begins: nothing of this one can be taken back from there. */
export function forgetDeeds() {
  deeds = [];
  changed();
}

/** @param {() => void} listener @returns {() => void} stop */
export function whenDeedsChange(listener) {
  changes.addEventListener("change", listener);
  return () => changes.removeEventListener("change", listener);
}

/**
 * The merge patch that leads from `after` back to `before`: what was added is removed by null.
 * @param {unknown} before
 * @param {unknown} after
 * @returns {unknown}
 */
export function patchBack(before, after) {
  if (!isRecord(before) || !isRecord(after)) return before ?? null;
  const names = [...new Set([...Object.keys(before), ...Object.keys(after)])];
  return Object.fromEntries(names.filter((name) => before[name] !== after[name]).map((name) => [name, patchBack(before[name], after[name])]));
}

/** @param {unknown} value @returns {value is Record<string, unknown>} */
function isRecord(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
