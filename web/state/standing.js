// What a session's answer is, and whether its verification speaks against it.

/** @import {SessionState} from "./session.js" */

/** Whether a stage's result is the session's one answer. @param {SessionState} state @param {string} stage */
export const isTheAnswer = ({ results, stages }, stage) => stage === stages.findLast(({ name, is_answer }) => is_answer && results[name])?.name;

/** Whether it is, and failed to be verified. @param {SessionState} state @param {string} stage */
export function isRefuted(state, stage) {
  const verified = /** @type {{ decision?: string } | undefined} */ (state.results["verify"]);
  return isTheAnswer(state, stage) && verified?.decision?.endsWith("fail") === true;
}
