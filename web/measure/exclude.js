// Leaving captures out of the solve and taking them in again, one or several, with the way back.

import { api } from "../state/api.js";
import { did } from "../state/undo.js";
import { plural, t } from "../texts.js";
import { attempt } from "../components/toasts.js";
import { whyDialog } from "./why-dialog.js";

/** @import {CaptureOut} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/** Captures whose change is on its way. @type {Set<string>} */
const changing = new Set();

/** Change captures unless they are being changed, as by the second half of a double click. @param {readonly CaptureOut[]} captures @param {() => Promise<unknown>} change */
export async function oncePer(captures, change) {
  if (captures.some(({ id }) => changing.has(id))) return;
  for (const { id } of captures) changing.add(id);
  try {
    await change();
  } finally {
    for (const { id } of captures) changing.delete(id);
  }
}

/** @param {SessionState} state @param {CaptureOut} capture @param {() => void} [otherwise] where it is not gone on with */
export const excludeCapture = (state, capture, otherwise) => excludeCaptures(state, [capture], capture.excluded !== true, otherwise);

/**
 * Once a verification has decided, the reason is asked for and kept.
 * @param {SessionState} state
 * @param {readonly CaptureOut[]} captures
 * @param {boolean} excluded
 * @param {() => void} [otherwise] where it is not gone on with
 */
export async function excludeCaptures(state, captures, excluded, otherwise) {
  const [only] = captures;
  const words = captures.length === 1 && only
    ? t(excluded ? "captures.left_out" : "captures.taken_in", { capture: only.id })
    : plural(captures.length, excluded ? "captures.left_out_one" : "captures.taken_in_one", excluded ? "captures.left_out_many" : "captures.taken_in_many");
  const set = async (/** @type {(capture: CaptureOut) => boolean | null} */ value, why = "") => {
    const because = why ? { excluded_because: { why } } : {};
    for (const capture of captures) await api.changeCapture(state.id, capture.id, { excluded: value(capture), ...because });
  };
  const act = async (/** @type {string} */ why) => {
    await set(() => excluded, why);
    did(words, () => set((capture) => capture.excluded ?? null), { redo: () => set(() => excluded, why) });
  };
  const title = t(excluded ? "captures.exclude_decided" : "captures.include_decided");
  await oncePer(captures, () => withReason(state, { title, go: t(excluded ? "captures.exclude" : "captures.include"), act, otherwise }));
}

/** The verification that has decided, where one has. @param {SessionState} state */
export function decisionOf(state) {
  const verified = /** @type {{ decision?: string | null, solved?: string | null }} */ (state.results["verify"] ?? {});
  return verified.decision ? verified : undefined;
}

/**
 * Do what changes the captures; once a verification has decided, with the reason that is asked for.
 * @param {SessionState} state
 * @param {{ title: string, go: string, act: (why: string) => Promise<unknown>, otherwise?: (() => void) | undefined }} deed
 */
export async function withReason(state, { act, ...deed }) {
  if (decisionOf(state)) whyDialog({ ...deed, words: [t("captures.decided_words")], act, after: () => undefined });
  else await attempt(() => act(""));
}
