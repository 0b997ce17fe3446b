// What was done and can be undone, and what was undone and can be redone. Each deed asks the server for its opposite, so
// that everybody sees it.

import { Problem } from "./http.js";

/** @typedef {{ text: string, undo: () => Promise<unknown>, redo: (() => Promise<unknown>) | undefined }} Deed */

const MOST = 50;
/** @type {Deed[]} */ let done = [];
/** @type {Deed[]} */ let undone = [];
const events = new EventTarget();
const changed = () => void events.dispatchEvent(new Event("change"));

/**
 * Note something that was done and how to undo it; `tell` shows it as a notice, too.
 * @param {string} text
 * @param {() => Promise<unknown>} undo
 * @param {{ tell?: boolean, redo?: () => Promise<unknown> }} [options]
 */
export function did(text, undo, { tell = false, redo } = {}) {
  const deed = { text, undo, redo };
  done = [...done, deed].slice(-MOST);
  undone = [];
  if (tell) events.dispatchEvent(new CustomEvent("tell", { detail: deed }));
  changed();
}

/** Undo a deed, the last one where none is named; answers it, or null where there is none. @param {Deed} [deed] */
export async function undo(deed = done.at(-1)) {
  if (!deed || !done.includes(deed)) return null;
  const place = done.indexOf(deed);
  done = done.filter((one) => one !== deed);
  changed();
  try {
    await deed.undo();
    if (deed.redo) undone.push(deed);
  } catch (error) {
    // Where the server was away it can be tried again; what it refused will not come right by itself.
    if (error instanceof Problem && error.status === 0) done.splice(place, 0, deed);
    throw error;
  } finally {
    changed();
  }
  return deed;
}

/** Do again what was undone last; answers it, or null where there is none. */
export async function redo() {
  const deed = undone.pop();
  if (!deed?.redo) return null;
  try {
    await deed.redo();
    done.push(deed);
  } catch (error) {
    if (error instanceof Problem && error.status === 0) undone.push(deed);
    throw error;
  } finally {
    changed();
  }
  return deed;
}

/** What would be undone and redone next. */
export const next = () => ({ undo: done.at(-1)?.text ?? null, redo: undone.at(-1)?.text ?? null });

/** Another session begins: nothing of this one can be undone from there. */
export function forgetDeeds() {
  done = [];
  undone = [];
  changed();
}

/** @param {() => void} listener @returns {() => void} stop */
export function whenDeedsChange(listener) {
  events.addEventListener("change", listener);
  return () => events.removeEventListener("change", listener);
}

/** Show deeds that are to be told. @param {(deed: Deed) => void} show */
export function whenTold(show) {
  events.addEventListener("tell", (event) => show(/** @type {CustomEvent<Deed>} */ (event).detail));
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
