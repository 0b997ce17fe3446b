// What became of files that were sent, told with the way back.

import "../texts/later.js";
import { did } from "../state/undo.js";
import { plural, t } from "../texts.js";
import { notify } from "../components/toasts.js";
import { keep } from "./removed-captures.js";

/** @import {Outcome} from "../state/upload.js" */

/** Tell what was sent, which can be undone, and what was not. @param {string} sessionId @param {Outcome} outcome */
export function tellSent(sessionId, { sent, problems }) {
  if (sent.length) {
    const { remove, restore } = keep(sessionId, sent);
    did(plural(sent.length, "intake.sent_one", "intake.sent_many"), remove, { tell: true, redo: restore });
  }
  for (const problem of problems.slice(0, 1)) notify(problem, { bad: true });
  if (problems.length > 1) notify(t("intake.more_problems", { count: problems.length - 1 }), { bad: true });
}
