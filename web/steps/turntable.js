// The turntable: its axis and frame in numbers, beside the paper's circles, and its wobble; alone or in the whole chain.

import { h } from "../dom.js";
import { decimalsFor, decimalsForAll, fixed, measured, plusMinus, significant, small } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { anglePlot } from "../components/angle-plot.js";
import { residualPlot } from "../components/residual-plot.js";
import { positionSigmas_mm, rotationSigmas_deg, worst } from "../uncertainty.js";
import { banner, compareRow, framePanel, K, pair, rawNumbers, verdictWord, workpiecePanel } from "./parts.js";

/** @import {ChainResult, StageResult, TableResult, TurntableResidual} from "../model.js" */
/** @import {SessionState} from "../state.js" */

const DEGREE = Math.PI / 180;

/** @param {TableResult} result @param {string} name */
function summary(result, name) {
  const tool = isChain(result) ? result : null;
  return [h(
    "div", { class: "answer" },
    h("h3", {}, name, " ", mark(result.stale ? "stale" : result.verdict, verdictWord(result))),
    h("p", { class: "number" }, h("span", {}, plusMinus(result.axis_point_sigma_mm * K, "mm")), h("br"), h("span", {}, plusMinus(result.axis_direction_sigma_deg * K, "°"))),
    tool && h("p", { class: "small soft" }, `${t("tcp.name")} ${plusMinus(worst(positionSigmas_mm(tool)) * K, "mm")} ${plusMinus(worst(rotationSigmas_deg(tool.covariance)) * K, "°")}`),
    ...(result.undetermined ?? []).map((one) => h("p", { class: "small open" }, one.description)),
  )];
}

/** @param {TableResult} result @returns {result is ChainResult} */
function isChain(result) {
  return "turntable_covariance" in result;
}

/**
 * @param {TableResult} result
 * @param {SessionState} state
 * @param {string} name
 */
function sections(result, state, name) {
  const covariance = isChain(result) ? result.turntable_covariance : result.covariance;
  const written = isChain(result) ? state.tool?.chain : state.tool?.turntable;
  const table = framePanel(state, {
    id: "table-frame", title: t("table.frame"), what: "table.frame_what", matrix: result.base_from_turntable,
    sigmas_mm: positionSigmas_mm({ covariance }), written: written?.conventions,
  });
  return [
    banner(result, name),
    h("div", { class: "result-pair" }, table, axis(result)),
    isChain(result) ? h("div", { class: "result-pair" }, chainTool(result, state), noise(result)) : null,
    workpiecePanel(result),
    wobble(result, state),
    circles(result),
    isChain(result) ? residuals(result, state) : null,
    rawNumbers(result, result.base_from_turntable, t("table.raw")),
  ];
}

/** @param {TableResult} result */
function axis(result) {
  const sigmas = result.axis_point_covariance.map((row, index) => Math.sqrt(Math.max(row[index] ?? 0, 0)));
  const decimals = decimalsForAll([worst(sigmas) * K]);
  const angle = result.axis_direction_sigma_deg * K;
  const digits = decimalsFor(angle * DEGREE);
  const scale = result.encoder_scale;
  return h(
    "section", { class: "panel", "aria-labelledby": "axis-title" },
    h("h2", { id: "axis-title" }, t("table.axis")),
    h("dl", { class: "pairs number" },
      pair(t("table.direction"), result.axis_direction_in_base.map((value) => fixed(value, digits)).join("  ")),
      pair(t("table.direction_sigma"), plusMinus(angle, "°")),
      ...["x", "y", "z"].map((name, index) => pair(t("table.point", { axis: name }), measured(result.axis_point_in_base_mm[index] ?? 0, Math.max((sigmas[index] ?? 0) * K, 10 ** -decimals), "mm", decimals))),
      pair(t("table.turns"), t(result.direction === 1 ? "table.positive" : "table.negative")),
      pair(t("table.encoder"), `${measured(scale.error * 1e6, scale.sigma * K * 1e6, "ppm")}${scale.applied ? ` ${t("table.applied")}` : ""}`),
    ),
    h("h3", {}, t("table.off")),
    h("dl", { class: "pairs number" },
      pair(t("table.radial_mm"), small(result.radial_rms_mm)),
      pair(t("table.axial_mm"), small(result.axial_rms_mm)),
      pair(t("table.angle_deg"), `${significant(result.angle_rms_deg, 2)}°`),
      pair(t("evidence.captures"), t("evidence.used_of", { used: tableRows(result).filter((row) => row.used).length, all: tableRows(result).length })),
    ),
  );
}

/** @param {TableResult} result @returns {TurntableResidual[]} */
function tableRows(result) {
  return result.residuals.filter((row) => "table_deg" in row && typeof row.table_deg === "number");
}

/** @param {TableResult} result @param {SessionState} state */
function wobble(result, state) {
  const rows = tableRows(result);
  return h(
    "section", { class: "panel", "aria-labelledby": "wobble-title" },
    h("h2", { id: "wobble-title" }, t("table.wobble")),
    h("p", { class: "soft small" }, t("table.wobble_what")),
    h("h3", {}, t("table.plot_mm")),
    anglePlot(rows, { figures: ["radial_mm", "axial_mm"], unit: "mm", label: t("table.plot_mm") }, state),
    h("h3", {}, t("table.plot_deg")),
    anglePlot(rows, { figures: ["angle_deg"], unit: "°", label: t("table.plot_deg") }, state),
  );
}

/** The paper's circles beside the joint answer. @param {TableResult} result */
function circles(result) {
  const found = result.circles ?? [];
  if (!found.length) return null;
  const rows = [];
  const other = result.circles_axis_direction_in_base;
  if (other) {
    const angle = between_deg(result.axis_direction_in_base, other);
    rows.push(compareRow(t("table.direction"), plusMinus(result.axis_direction_sigma_deg * K, "°"), t("compare.turned", { angle: significant(angle, 2) }), `${fixed(angle / result.axis_direction_sigma_deg, 1)} σ`));
  }
  for (const circle of found) {
    const joint = result.mounts.find(({ mount }) => mount === circle.mount);
    const { mount } = circle;
    rows.push(compareRow(t("table.radius", { mount }), joint ? `${fixed(joint.radius_mm, 3)} mm` : "–", `${fixed(circle.radius_mm, 3)} mm`, joint ? small(circle.radius_mm - joint.radius_mm) : ""));
    rows.push(compareRow(t("table.circle_rms", { mount }), "", small(circle.circle_rms_mm), ""));
    rows.push(compareRow(t("table.plane_rms", { mount }), "", small(circle.plane_rms_mm), ""));
  }
  const heads = [t("compare.what"), t("compare.joint"), t("table.circles_head"), t("compare.difference")];
  return h(
    "section", { class: "panel", "aria-labelledby": "circles-title" },
    h("h2", { id: "circles-title" }, t("table.circles")),
    h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...heads.map((head, index) => h("th", { scope: "col", class: index > 0 && "right" }, head)))),
      h("tbody", {}, ...rows)),
    h("p", { class: "soft small" }, t("table.circles_note")),
  );
}

/** @param {readonly number[]} a @param {readonly number[]} b */
function between_deg(a, b) {
  const part = (/** @type {number} */ i, /** @type {number} */ j) => (a[i] ?? 0) * (b[j] ?? 0) - (a[j] ?? 0) * (b[i] ?? 0);
  return Math.asin(Math.min(1, Math.hypot(part(1, 2), part(2, 0), part(0, 1)))) / DEGREE;
}

/** @param {ChainResult} result @param {SessionState} state */
function chainTool(result, state) {
  return framePanel(state, {
    id: "chain-tool", title: t("chain.tool"), what: "frame.what", matrix: result.tool0_from_laser,
    sigmas_mm: positionSigmas_mm(result), written: state.tool?.chain?.tool_conventions,
  });
}

/** @param {ChainResult} result */
function noise(result) {
  const alone = result.variance_components;
  return h(
    "section", { class: "panel", "aria-labelledby": "chain-title" },
    h("h2", { id: "chain-title" }, t("evidence.title")),
    h("dl", { class: "pairs number" },
      pair(t("evidence.rotation"), plusMinus(worst(rotationSigmas_deg(result.covariance)) * K, "°")),
      pair(t("evidence.scatter"), small(result.center_scatter_rms_mm)),
      pair(t("evidence.surface"), small(result.surface_rms_mm)),
      pair(t("evidence.captures"), t("evidence.used_of", { used: result.residuals.filter((row) => row.used).length, all: result.residuals.length })),
      pair(t("evidence.position"), small(alone.position_sigma_mm)),
      pair(t("evidence.orientation"), `${significant(alone.orientation_sigma_deg, 2)}°`),
    ),
  );
}

/** @param {ChainResult} result @param {SessionState} state */
function residuals(result, state) {
  return h(
    "section", { class: "panel", "aria-labelledby": "chain-residuals-title" },
    h("h2", { id: "chain-residuals-title" }, t("residuals.title")),
    h("p", { class: "soft small" }, t("residuals.what")),
    residualPlot(result, state),
  );
}

/** @param {"step.turntable" | "step.chain"} name @returns {import("./index.js").StepPage} */
const page = (name) => ({
  summary: (/** @type {StageResult} */ result) => summary(/** @type {TableResult} */ (result), t(name)),
  result: (result, state) => sections(/** @type {TableResult} */ (result), state, t(name)),
});

export const turntable = page("step.turntable");
export const chain = page("step.chain");
