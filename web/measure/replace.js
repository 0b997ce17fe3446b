// Taking a capture again from where it was taken: the new one takes the old one's place, which is left out and kept.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { kindOf, takenOf } from "../state/files.js";
import { said, t } from "../texts.js";
import { did } from "../state/undo.js";
import { oncePer, withReason } from "./exclude.js";
import { keep } from "./removed-captures.js";
import { notify } from "../components/toasts.js";

/** @import {CaptureOut} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/**
 * @param {SessionState} state
 * @param {CaptureOut} capture
 */
export function replaceCapture(state, capture) {
  const begin = (/** @type {() => Promise<CaptureOut>} */ take) => void oncePer([capture], () => withReason(state, {
    title: t("captures.redo_decided", { capture: capture.id }), go: t("captures.redo_go"), act: async (why) => settle(state, capture, await take(), why),
  }));
  if (state.session?.simulated) return begin(() => api.captureAgain(state.id, capture.id));
  const picker = h("input", { type: "file", class: "visually-hidden", "aria-label": t("captures.redo", { capture: capture.id }) });
  picker.addEventListener("change", () => {
    const file = picker.files?.[0];
    picker.remove();
    if (file) begin(() => replacement(state, capture, file));
  });
  picker.addEventListener("cancel", () => picker.remove());
  document.body.append(picker);
  picker.click();
}

/**
 * @param {SessionState} state
 * @param {CaptureOut} capture
 * @param {File} file
 */
function replacement(state, capture, file) {
  const { id, captures, session } = state;
  const { measured: _, excluded: _e, excluded_because: _b, included_because: _i, ...record } = capture;
  const name = nextId(capture.id, new Set(captures.map((one) => one.id)));
  const ending = file.name.slice(file.name.lastIndexOf(".")).toLowerCase();
  const kind = kindOf(file.name, session?.cell.scanner?.kind);
  return api.addCapture(id, { ...record, ...takenOf(file), id: name, kind, files: [`captures/${name}${ending}`] }, [file]);
}

/**
 * Let the new capture take the old one's place, unless it is refused, too.
 * @param {SessionState} state
 * @param {CaptureOut} capture
 * @param {CaptureOut} taken
 * @param {string} why
 */
async function settle({ id }, capture, taken, why) {
  const { id: name } = taken;
  const { verdict, reason, to_do } = taken.measured;
  const { excluded } = capture;
  const added = keep(id, [taken]);
  if (verdict === "fail") {
    did(t("captures.added", { captures: name }), added.remove, { redo: added.restore });
    notify(t("captures.redo_failed", { old: capture.id, new: name, reason: said(reason ?? to_do ?? "") }), { bad: true });
    return;
  }
  const leaveOut = () => api.changeCapture(id, capture.id, { excluded: true, ...(why ? { excluded_because: { why } } : {}) });
  await leaveOut();
  const undo = async () => {
    await api.changeCapture(id, capture.id, { excluded: excluded ?? null });
    await added.remove();
  };
  const redo = async () => {
    await added.restore();
    await leaveOut();
  };
  did(t("captures.redone", { old: capture.id, new: name }), undo, { tell: true, redo });
}

/** `p05-again`, `p05-again2`, … @param {string} id @param {ReadonlySet<string>} taken */
function nextId(id, taken) {
  const first = `${id.replace(/-again\d*$/, "")}-again`;
  let name = first;
  for (let number = 2; taken.has(name); number++) name = `${first}${number}`;
  return name;
}
