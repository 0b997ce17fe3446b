// What a session's answer is, and whether its verification speaks against it.

/** @import {StageResult} from "./model.js" */
/** @import {SessionState} from "./session.js" */

/** Whether a stage's result is the session's one answer. @param {SessionState} state @param {string} stage */
export const isTheAnswer = ({ results, stages }, stage) => stage === stages.findLast(({ name, is_answer }) => is_answer && results[name])?.name;

/** Whether it is, and failed to be verified. @param {SessionState} state @param {string} stage */
export function isRefuted(state, stage) {
  const verified = /** @type {{ decision?: string } | undefined} */ (state.results["verify"]);
  return isTheAnswer(state, stage) && verified?.decision?.endsWith("fail") === true;
}

/** Of a machine of few axes: what its motions leave open no further capture of it tells. */
const BY_MOTIONS = ["tool-position-without-turns", "tool-rotation-about-travel"];

/** Whether more captures would better a result that is usable. @param {StageResult | null} [result] */
export const isToImprove = (result) => result?.verdict === "warn" && (result.findings ?? []).some(({ code, severity }) => severity === "warning" && !BY_MOTIONS.includes(code));
