// Captures that come after a decision: why, asked for once and kept with all that come until the next one.

import "../texts/later.js";
import { t } from "../texts.js";
import { attempt } from "../components/toasts.js";
import { decisionOf } from "./exclude.js";
import { whyDialog } from "./why-dialog.js";

/** @import {SessionState} from "../state/session.js" */

/** By the decision that they are told after. @type {Map<string, string>} */
const reasons = new Map();

/**
 * What came of it; nothing where it was not gone on with, or failed.
 * @template T
 * @param {SessionState} state
 * @param {(why: string) => Promise<T>} add
 * @returns {Promise<T | undefined>}
 */
export async function addedWithReason(state, add) {
  const decision = decisionOf(state), after = `${state.id} ${decision?.solved ?? ""}`;
  if (!decision || reasons.has(after)) {
    /** @type {T | undefined} */ let done;
    await attempt(async () => { done = await add(reasons.get(after) ?? ""); });
    return done;
  }
  return new Promise((resolve) => {
    const act = async (/** @type {string} */ why) => {
      const done = await add(why);
      reasons.set(after, why);
      resolve(done);
    };
    whyDialog({ title: t("captures.add_decided"), go: t("captures.add_go"), words: [t("captures.decided_words")], act, after: () => undefined, otherwise: () => resolve(undefined) });
  });
}
