// Leaving captures out of the solve and taking them in again, one or several, with the way back.

import { api } from "../state/api.js";
import { did } from "../state/undo.js";
import { plural, t } from "../texts.js";
import { attempt } from "../components/toasts.js";

/** @import {CaptureOut} from "../state/model.js" */

/** @param {string} sessionId @param {CaptureOut} capture */
export const excludeCapture = (sessionId, capture) => excludeCaptures(sessionId, [capture], capture.excluded !== true);

/**
 * @param {string} sessionId
 * @param {readonly CaptureOut[]} captures
 * @param {boolean} excluded
 */
export async function excludeCaptures(sessionId, captures, excluded) {
  const set = async (/** @type {(capture: CaptureOut) => boolean | null} */ value) => {
    for (const capture of captures) await api.changeCapture(sessionId, capture.id, { excluded: value(capture) });
  };
  const [only] = captures;
  const words = captures.length === 1 && only
    ? t(excluded ? "captures.left_out" : "captures.taken_in", { capture: only.id })
    : plural(captures.length, excluded ? "captures.left_out_one" : "captures.taken_in_one", excluded ? "captures.left_out_many" : "captures.taken_in_many");
  await attempt(async () => {
    await set(() => excluded);
    did(words, () => set((capture) => capture.excluded ?? null), { redo: () => set(() => excluded) });
  });
}
