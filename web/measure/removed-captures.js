// Captures that are removed with the way back: their records and files are kept in the page for it.

import { api } from "../state/api.js";

/** @import {Capture, CaptureOut} from "../state/model.js" */

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
