// What mends a failed or doubtful result at once: its root causes, each with what it is, the evidence, and Apply.

import { api } from "../state/api.js";
import { h } from "../dom.js";
import { did } from "../state/undo.js";
import { pointed, said, t } from "../texts.js";
import { attempt } from "./toasts.js";

/** @import {RootCause, StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */
/** @typedef {{ name: string, words: string, mend: () => Promise<unknown> }} Remedy */

/** The root causes of a fresh result. @param {Partial<StageResult>} result @returns {RootCause[]} */
export const causesOf = (result) => (result.stale ? [] : /** @type {RootCause[]} */ (result.causes ?? []));

/** Those of them that something mends. @param {Partial<StageResult>} result */
export const mendable = (result) => causesOf(result).filter(({ changes }) => changes);

/** @param {SessionState} state @param {string} stage @param {readonly RootCause[]} causes @returns {Remedy[]} */
export const remedies = (state, stage, causes) => causes.filter(({ changes }) => changes).map((cause) => ({
  name: t("remedy.apply", { title: said(cause.title) }),
  words: said(cause.sentence),
  mend: () => apply(state, stage, cause),
}));

/** @param {SessionState} state @param {string} stage @param {RootCause} cause */
const apply = (state, stage, cause) => attempt(async () => {
  const { undo, changes } = await api.applyCause(state.id, cause.id);
  did(t("remedy.applied", { title: said(cause.title) }), () => api.changeTogether(state.id, undo), { redo: () => api.changeTogether(state.id, changes) });
  state.follows(await api.solve(state.id, stage));
});

/** One card a cause, the likeliest first; a reviewed past has no buttons. @param {SessionState} state @param {string} stage @param {StageResult} result */
export function causeCards(state, stage, result) {
  const causes = causesOf(result);
  if (!causes.length) return null;
  return h("ul", { class: "causes" }, ...causes.map((cause) => {
    const [remedy] = "timeline" in state ? [] : remedies(state, stage, [cause]);
    return h("li", { class: "cause" },
      h("h3", {}, said(cause.title)),
      h("p", { class: "small" }, said(cause.sentence)),
      ...(cause.evidence ?? []).map(evidence),
      remedy && h("button", { type: "button", needs: "capture", onclick: () => void remedy.mend() }, t("remedy.do")));
  }));
}

/** @param {NonNullable<RootCause["evidence"]>[number]} figure */
function evidence({ label, unit, before, after }) {
  const words = (/** @type {number | null} */ value) => (value === null ? "–" : `${pointed(String(Number(value.toPrecision(3))))}\u00a0${unit}`);
  return h("p", { class: "small soft number" }, after === null ? `${said(label)}: ${words(before)}` : t("remedy.evidence", { label: said(label), before: words(before), after: words(after) }));
}
