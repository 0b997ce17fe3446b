// The plane of light: where it lies in the camera, and how each stripe lies on it.

import { h } from "../dom.js";
import { decimalsFor, fixed, integer, measured, millimetres, plusMinus, small } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { banner, K, pair, rawNumbers, verdictWord } from "./parts.js";

/** @import {LaserPlaneResult, StageResult} from "../model.js" */

const DEGREE = Math.PI / 180;

/** @param {LaserPlaneResult} result */
function summary(result) {
  return [h(
    "div", { class: "answer" },
    h("h3", {}, t("step.laser-plane"), " ", mark(result.stale ? "stale" : result.verdict, verdictWord(result))),
    h("p", { class: "number" }, h("span", {}, plusMinus(result.distance_sigma_mm * K, "mm")), h("br"), h("span", {}, plusMinus(result.normal_sigma_deg * K, "°"))),
  )];
}

/** @param {LaserPlaneResult} result */
function sections(result) {
  return [banner(result, t("step.laser-plane")), numbers(result), stripes(result), rawNumbers(result, result.camera_from_laser, t("plane.raw"))];
}

/** @param {LaserPlaneResult} result */
function numbers(result) {
  const { normal, distance_mm } = result.plane_in_camera;
  const digits = decimalsFor(result.normal_sigma_deg * K * DEGREE);
  return h(
    "section", { class: "panel", "aria-labelledby": "plane-title" },
    h("h2", { id: "plane-title" }, t("plane.numbers")),
    h("dl", { class: "pairs number" },
      pair(t("plane.normal"), normal.map((value) => fixed(value, digits)).join("  ")),
      pair(t("table.direction_sigma"), plusMinus(result.normal_sigma_deg * K, "°")),
      pair(t("plane.distance"), measured(distance_mm, result.distance_sigma_mm * K, "mm")),
      pair(t("plane.rms"), small(result.plane_rms_mm)),
      pair(t("evidence.captures"), t("evidence.used_of", { used: result.residuals.filter((row) => row.used).length, all: result.residuals.length })),
    ),
  );
}

/** @param {LaserPlaneResult} result */
function stripes({ residuals }) {
  const heads = [t("plane.board"), t("plane.distance_head"), t("plane.points"), t("plane.off"), t("plane.mean")];
  return h(
    "section", { class: "panel", "aria-labelledby": "stripes-title" },
    h("h2", { id: "stripes-title" }, t("plane.stripes")),
    h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...heads.map((head, index) => h("th", { scope: "col", class: index > 0 && "right" }, head)))),
      h("tbody", {}, ...residuals.map((row) => h("tr", {},
        h("th", { scope: "row" }, row.capture, " ", !row.used && mark("fail", t("captures.rejected"))),
        ...[millimetres(row.board_distance_mm, 0), integer(row.points ?? 0), small(row.line_rms_mm), small(row.line_mean_mm)].map((text) => h("td", { class: "right" }, text)))))),
  );
}

/** @type {import("./index.js").StepPage} */
export const laserPlane = {
  summary: (/** @type {StageResult} */ result) => summary(/** @type {LaserPlaneResult} */ (result)),
  result: (/** @type {StageResult} */ result) => sections(/** @type {LaserPlaneResult} */ (result)),
};
