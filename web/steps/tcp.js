// The TCP: the scanner's frame on the flange, in numbers, beside the paper's two steps, with its evidence.

import { h } from "../dom.js";
import { decimalsForAll, fixed, measured, plusMinus, significant, small } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { residualPlot } from "../components/residual-plot.js";
import { banner, compareRow, framePanel, K, pair, rawNumbers, verdictWord, workpiecePanel } from "./parts.js";
import { differenceInSigmas, differenceSigma, positionSigmas_mm, rotationSigmas_deg, worst } from "../uncertainty.js";

/** @import {StageResult, TcpResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */

/** @param {TcpResult} result */
function summary(result) {
  const position = worst(positionSigmas_mm(result)) * K;
  const rotation = worst(rotationSigmas_deg(result.covariance)) * K;
  return [
    h("div", { class: "answer" },
      h("h3", {}, t("tcp.name"), " ", mark(result.stale ? "stale" : result.verdict, verdictWord(result))),
      h("p", { class: "number" }, h("span", {}, plusMinus(position, "mm")), h("br"), h("span", {}, plusMinus(rotation, "°"))),
      ...(result.undetermined ?? []).map((one) => h("p", { class: "small open" }, one.description)),
    ),
  ];
}

/**
 * @param {TcpResult} result
 * @param {SessionState} state
 */
function* sections(result, state) {
  yield banner(result);
  yield h("div", { class: "result-pair" }, toolFrame(result, state), evidence(result));
  yield workpiecePanel(result);
  yield plot(result, state);
  yield comparison(result);
  yield rawNumbers(result, result.tool0_from_laser);
}

/** @param {TcpResult} result */
function evidence(result) {
  const used = result.residuals.filter((row) => row.used).length;
  const parts = result.variance_components;
  const estimated = new Set(parts?.estimated ?? []);
  const origin = (/** @type {string} */ name) => t(estimated.has(name) ? "evidence.estimated" : "evidence.given");
  return h(
    "section", { class: "panel", "aria-labelledby": "evidence-title" },
    h("h2", { id: "evidence-title" }, t("evidence.title")),
    h("dl", { class: "pairs number" },
      pair(t("evidence.rotation"), plusMinus(worst(rotationSigmas_deg(result.covariance)) * K, "°")),
      pair(t("evidence.scatter"), small(result.center_scatter_rms_mm)),
      pair(t("evidence.surface"), small(result.surface_rms_mm)),
      pair(t("evidence.left_out"), small(result.leave_one_out_surface_rms_mm)),
      pair(t("evidence.captures"), t("evidence.used_of", { used, all: result.residuals.length })),
    ),
    parts && h("h3", {}, t("evidence.noise")),
    parts && h("dl", { class: "pairs number" },
      pair(t("evidence.point"), `${small(parts.point_sigma_mm)} ${origin("point_sigma_mm")}`),
      pair(t("evidence.position"), `${small(parts.position_sigma_mm)} ${origin("position_sigma_mm")}`),
      pair(t("evidence.orientation"), `${significant(parts.orientation_sigma_deg, 2)}° ${origin("orientation_sigma_rad")}`),
    ),
  );
}

/**
 * @param {TcpResult} result
 * @param {SessionState} state
 */
function plot(result, state) {
  return h(
    "section", { class: "panel", "aria-labelledby": "residuals-title" },
    h("h2", { id: "residuals-title" }, t("residuals.title")),
    h("p", { class: "soft small" }, t("residuals.what")),
    residualPlot(result, state),
    ...byOrientation(result, state),
  );
}

/** @param {TcpResult} result @param {SessionState} state */
function byOrientation(result, state) {
  const turned = result.turned_deg ?? {};
  if (Object.values(turned).every((angle) => angle < 1)) return [];
  return [h("h3", {}, t("residuals.by_turn")), h("p", { class: "soft small" }, t("residuals.by_turn_what")), residualPlot(result, state, turned)];
}

/** @param {TcpResult} result */
function comparison(result) {
  const two = result.two_step;
  if (!two) return null;
  const other = two.tool0_from_laser;
  const body = other ? h("tbody", {}, ...comparisonRows(result, other)) : null;
  return h(
    "section", { class: "panel", "aria-labelledby": "compare-title" },
    h("h2", { id: "compare-title" }, t("compare.title")),
    two.reason && h("p", { class: "soft" }, two.reason),
    body && h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...["what", "joint", "two", "difference"].map((name, index) =>
        h("th", { scope: "col", class: index > 0 && "right" }, t(/** @type {"compare.what"} */ (`compare.${name}`)))))),
      body),
    body && h("p", { class: "soft small" }, t(two.covariance ? "compare.note" : "compare.note_joint")),
  );
}

/**
 * @param {TcpResult} result
 * @param {number[][]} other
 */
function comparisonRows(result, other) {
  const sigmas = positionSigmas_mm(result);
  const covariance = result.two_step?.covariance ?? null;
  const decimals = decimalsForAll(sigmas.map((sigma) => sigma * K));
  const rows = ["x", "y", "z"].map((axis, index) => {
    const mine = result.tool0_from_laser[index]?.[3] ?? 0;
    const theirs = other[index]?.[3] ?? 0;
    const sigma = sigmas[index] ?? 0;
    const variance = covariance?.[3 + index]?.[3 + index];
    const shown = variance ? measured(theirs, Math.sqrt(variance) * K, "mm", decimals) : `${fixed(theirs, decimals)} mm`;
    const apart = (theirs - mine) / (variance ? differenceSigma(variance, sigma ** 2) : sigma);
    return compareRow(t("compare.axis", { axis }), measured(mine, sigma * K, "mm", decimals), shown, `${fixed(apart, 1)} σ`);
  });
  const turned = differenceInSigmas(result, other, covariance);
  rows.push(compareRow(t("compare.rotation"), plusMinus(worst(rotationSigmas_deg(result.covariance)) * K, "°"), t("compare.turned", { angle: significant(turned.angle_deg, 2) }), `${fixed(turned.sigmas, 1)} σ`));
  const two = result.two_step;
  rows.push(compareRow(t("evidence.scatter"), small(result.center_scatter_rms_mm), small(two?.center_scatter_rms_mm), ""));
  rows.push(compareRow(t("evidence.left_out"), small(result.leave_one_out_surface_rms_mm), small(two?.leave_one_out_surface_rms_mm), ""));
  return rows;
}

/**
 * The tool frame as the controller wants it typed in, each number with its own uncertainty.
 * @param {TcpResult} result
 * @param {SessionState} state
 */
function toolFrame(result, state) {
  return framePanel(state, {
    id: "frame", title: t("frame.title"), what: "frame.what", matrix: result.tool0_from_laser,
    sigmas_mm: positionSigmas_mm(result), written: state.tool?.conventions,
  });
}

/** @type {import("./index.js").StepPage} */
export const tcp = {
  summary: (/** @type {StageResult} */ result) => summary(/** @type {TcpResult} */ (result)),
  result: (result, state) => sections(/** @type {TcpResult} */ (result), state),
};
