// How the answer would move if a capture were excluded, before anything is solved again: the result tells it of each capture.

import { small, stated } from "../format.js";
import { t } from "../texts.js";

/** @import {FigureBlock, Residual, StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/** One sentence; null where no fresh result knows. @param {SessionState | null} state @param {string | undefined} capture */
export function withoutWords(state, capture) {
  if (!state || !capture || "timeline" in state) return null;
  for (const result of Object.values(state.results)) {
    const row = /** @type {Residual[]} */ (result.residuals ?? []).find((one) => one.capture === capture);
    const now = knownTo(result);
    if (result.stale || !now || typeof row?.shift_without_mm !== "number") continue;
    return t("without.words", { capture, shift: small(row.shift_without_mm), now: stated(now), then: stated(now * (row.growth_without ?? 1)) });
  }
  return null;
}

/** The headline's uncertainty at the workpiece. @param {StageResult} result */
function knownTo({ evidence }) {
  const figures = /** @type {FigureBlock[]} */ ((evidence ?? []).filter(({ kind }) => kind === "figure"));
  return figures.find(({ headline, quantity }) => headline && quantity?.unit === "mm")?.quantity?.uncertainty ?? null;
}
