// A simulated cell knows its truth: how far the answer is off beside the uncertainty that it states.

import { api } from "../state/api.js";
import { h } from "../dom.js";
import { decimalsFor, fixed, plusMinus, significant } from "../format.js";
import { mark } from "../icons.js";
import { maybe, t } from "../texts.js";

/** @import {FrameDifference} from "../state/model.js" */

const K = 2;
/** Beyond this share of right answers a stated uncertainty is doubtful. */
const RARE = 0.05;

/** @param {string} sessionId @param {string} stage */
export function truthSection(sessionId, stage) {
  const section = h("section", { class: "panel truth", "aria-labelledby": "truth-title", hidden: true });
  // A stage without frames has no truth to show; where the server is away, the result still stands.
  void api.truth(sessionId, stage).then(({ frames }) => {
    section.hidden = frames.length === 0;
    section.replaceChildren(h("h2", { id: "truth-title" }, t("truth.title")), ...frames.map((frame) => line(frame, frames.length > 1)));
  }).catch(() => undefined);
  return section;
}

/** @param {FrameDifference} frame @param {boolean} named */
function line({ frame, at_workpiece_mm, at_workpiece_sigma_mm, angle_deg, chance }, named) {
  const within = chance >= RARE;
  const stated_mm = K * at_workpiece_sigma_mm;
  const name = maybe(`comparison.${frame}`, frame);
  return h("p", {},
    named && h("strong", {}, name.charAt(0).toUpperCase(), name.slice(1), ": "),
    t("truth.off", {
      error: `${fixed(at_workpiece_mm, decimalsFor(stated_mm))}\u202fmm`,
      angle: significant(angle_deg, 2),
      stated: plusMinus(stated_mm, "mm"),
      share: fixed(at_workpiece_mm / (stated_mm || 1), 1),
    }), " ",
    mark(within ? "pass" : "warn", t(within ? "truth.within" : "truth.beyond")));
}
