// What mends a failed or doubtful result at once: its root causes, the evidence for each, and what applying it does.

import { api } from "../state/api.js";
import { h } from "../dom.js";
import { did } from "../state/undo.js";
import { maybe, pointed, said, t } from "../texts.js";
import { attempt } from "../components/toasts.js";

/** @import {RootCause, StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */
/** @typedef {{ name: string, words: string, mend: () => Promise<unknown> }} Remedy */

/** The root causes of a fresh result. @param {Partial<StageResult>} result @returns {RootCause[]} */
export const causesOf = (result) => (result.stale ? [] : /** @type {RootCause[]} */ (result.causes ?? []));

/** Those of them that something mends. @param {Partial<StageResult>} result */
export const mendable = (result) => causesOf(result).filter(({ changes }) => changes);

/** @param {SessionState} state @param {string} stage @param {readonly RootCause[]} causes @returns {Remedy[]} */
export const remedies = (state, stage, causes) => causes.filter(({ changes }) => changes).map((cause) => ({
  name: deed(cause),
  words: said(cause.sentence ?? ""),
  mend: () => apply(state, stage, cause),
}));

/** What applying it does, in a few words. @param {RootCause} cause */
function deed({ kind, changes }) {
  const { pose_convention: convention, sphere_diameter_mm: diameter } = changes?.cell ?? {};
  if (convention) return t("remedy.convention", { convention: maybe(`convention.${convention}`, String(convention)) });
  if (diameter) return t("remedy.diameter", { diameter: Number(diameter) });
  return maybe(`remedy.${kind}`, t("remedy.apply"), { count: Object.keys(changes?.captures ?? {}).length });
}

/** @param {SessionState} state @param {string} stage @param {RootCause} cause */
const apply = (state, stage, cause) => attempt(async () => {
  const { undo, changes } = await api.applyCause(state.id, cause.id);
  did(deed(cause), () => api.changeTogether(state.id, undo), { redo: () => api.changeTogether(state.id, changes) });
  state.follows(await api.solve(state.id, stage));
});

/** The figures that speak for a cause. @param {RootCause} cause */
export const evidenceOfCause = (cause) => (cause.evidence ?? []).map(evidence);

/** @param {NonNullable<RootCause["evidence"]>[number]} figure */
function evidence({ label, unit, before, after }) {
  const words = (/** @type {number | null} */ value) => (value === null ? "–" : `${pointed(String(Number(value.toPrecision(3))))}\u00a0${unit}`);
  return h("p", { class: "small soft number" }, t("remedy.evidence", { label: said(label), figures: after === null ? words(before) : `${words(before)} → ${words(after)}` }));
}
