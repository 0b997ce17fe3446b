// Captures that are removed with the way back: their records and files are kept in the page for it.

import { api } from "../state/api.js";
import { did } from "../state/undo.js";
import { plural, t } from "../texts.js";
import { notify } from "../components/toasts.js";

/** @import {Capture, CaptureOut} from "../state/model.js" */
/** @import {Outcome} from "../state/upload.js" */

/** @param {string} sessionId @param {readonly (CaptureOut | Capture)[]} captures */
export function keep(sessionId, captures) {
  /** @type {{ record: Capture, files: File[] }[]} */
  let kept = [];
  const remove = async (why = "") => {
    kept = [];
    for (const capture of captures) {
      const { measured: _, ...record } = /** @type {CaptureOut} */ (capture);
      kept.push({ record, files: await Promise.all((capture.files ?? []).map((name) => api.captureFile(sessionId, capture.id, name))) });
      await api.removeCapture(sessionId, capture.id, why);
    }
  };
  const restore = async () => { for (const { record, files } of kept) await api.addCapture(sessionId, record, files); };
  return { remove, restore };
}

/** Tell what was sent, which can be undone, and what was not. @param {string} sessionId @param {Outcome} outcome */
export function tellSent(sessionId, { sent, problems }) {
  if (sent.length) {
    const { remove, restore } = keep(sessionId, sent);
    did(plural(sent.length, "intake.sent_one", "intake.sent_many"), remove, { tell: true, redo: restore });
  }
  for (const problem of problems.slice(0, 1)) notify(problem, { bad: true });
  if (problems.length > 1) notify(t("intake.more_problems", { count: problems.length - 1 }), { bad: true });
}
