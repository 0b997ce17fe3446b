// The TCP: the scanner's frame on the flange, in numbers, beside the paper's two steps, with its evidence.

import { api } from "../api.js";
import { h } from "../dom.js";
import { decimalsForAll, fixed, measured, plusMinus, significant, small } from "../format.js";
import { icon, mark } from "../icons.js";
import { maybe, t } from "../texts.js";
import { residualPlot } from "../components/residual-plot.js";
import { copyButton } from "../components/copy.js";
import { differenceInSigmas, positionSigmas_mm, rotationSigmas_deg, worst } from "../uncertainty.js";

/** @import {TcpResult, ToolFrame} from "../model.js" */
/** @import {SessionState} from "../state.js" */

const K = 2;

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

/** @param {TcpResult} result */
function verdictWord(result) {
  return result.stale ? t("result.stale") : maybe(`verdict.${result.verdict}`, result.verdict);
}

/**
 * @param {TcpResult} result
 * @param {SessionState} state
 */
function sections(result, state) {
  return [
    banner(result),
    h("div", { class: "result-pair" }, frame(result, state), evidence(result)),
    plot(result, state),
    comparison(result),
    rawNumbers(result),
  ];
}

/** @param {TcpResult} result */
function banner(result) {
  const verdict = result.stale ? "stale" : result.verdict;
  const words = result.stale ? t("result.stale_words") : t(`verdict.${result.verdict}_words`);
  return h(
    "section", { class: `banner banner-${verdict}`, "aria-label": t("result.verdict") },
    h("h2", {}, mark(verdict, verdictWord(result)), " ", h("span", { class: "words" }, words)),
    ...(result.undetermined ?? []).map((one) => h("p", {}, mark("warn", one.description))),
    ...list(result.warnings ?? []),
    ...list(result.residuals.flatMap((row) => (row.used || !row.reason ? [] : [`${row.capture}: ${row.reason}`]))),
  );
}

/** @param {string[]} sentences */
function list(sentences) {
  return sentences.length ? [h("ul", {}, ...sentences.map((sentence) => h("li", {}, sentence)))] : [];
}

/**
 * The tool frame as the controller wants it typed in, each number with its own uncertainty.
 * @param {TcpResult} result
 * @param {SessionState} state
 */
function frame(result, state) {
  const { convention, names, numbers, sigmas, text } = written(result, state.tool);
  return h(
    "section", { class: "panel frame", "aria-labelledby": "frame-title" },
    h("div", { class: "row spread" }, h("h2", { id: "frame-title" }, t("frame.title")), copyButton(text, t("frame.copy"))),
    h("p", { class: "soft small" }, t("frame.what", { convention: maybe(`convention.${convention}`, convention) })),
    h("div", { class: "frame-columns number" }, ...[0, 3].filter((start) => start < names.length).map((start) => {
      const end = start === 0 ? 3 : names.length;
      const decimals = decimalsForAll(sigmas.slice(start, end).map((sigma) => sigma * K));
      return h("dl", {}, ...names.slice(start, end).map((name, row) => {
        const index = start + row;
        const shown = measured(numbers[index] ?? 0, (sigmas[index] ?? 0) * K, unitOf(name, convention), decimals);
        return h("div", {}, h("dt", {}, name), h("dd", {}, shown));
      }));
    })),
    h("code", { class: "controller" }, text),
    h("p", { class: "small" }, h("a", { href: api.exportAddress(state.id, "json"), download: `${state.id}-tool.json` }, t("frame.export"))),
  );
}

/**
 * The frame's numbers in the cell's convention; a matrix is read by its translation.
 * @param {TcpResult} result
 * @param {ToolFrame | null} tool
 */
function written(result, tool) {
  const convention = tool?.pose_convention ?? "matrix";
  const found = tool?.conventions[convention];
  const all = found?.numbers ?? result.tool0_from_laser.flat();
  const text = all.map((number) => String(Number(number.toFixed(6)))).join(" ");
  if (!found || convention === "matrix") {
    const numbers = result.tool0_from_laser.slice(0, 3).map((row) => row[3] ?? 0);
    return { convention, names: ["x", "y", "z"], numbers, sigmas: positionSigmas_mm(result), text };
  }
  return { convention, names: found.names, numbers: found.numbers, sigmas: found.standard_deviations, text };
}

/** @param {string} name @param {string} convention */
function unitOf(name, convention) {
  if (/^q|^[xyz]?w$/.test(name)) return "";
  if (/^[xyz]$/i.test(name)) return convention === "ur" || convention === "ros" ? "m" : "mm";
  return convention === "ur" ? "rad" : "°";
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
  );
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
    body && h("p", { class: "soft small" }, t("compare.note")),
  );
}

/**
 * @param {TcpResult} result
 * @param {number[][]} other
 */
function comparisonRows(result, other) {
  const sigmas = positionSigmas_mm(result);
  const decimals = decimalsForAll(sigmas.map((sigma) => sigma * K));
  const rows = ["x", "y", "z"].map((axis, index) => {
    const mine = result.tool0_from_laser[index]?.[3] ?? 0;
    const theirs = other[index]?.[3] ?? 0;
    const sigma = sigmas[index] ?? 0;
    return compareRow(t("compare.axis", { axis }), measured(mine, sigma * K, "mm", decimals), `${fixed(theirs, decimals)} mm`, `${fixed((theirs - mine) / sigma, 1)} σ`);
  });
  const turned = differenceInSigmas(result, other);
  rows.push(compareRow(t("compare.rotation"), plusMinus(worst(rotationSigmas_deg(result.covariance)) * K, "°"), t("compare.turned", { angle: significant(turned.angle_deg, 2) }), `${fixed(turned.sigmas, 1)} σ`));
  const two = result.two_step;
  rows.push(compareRow(t("evidence.scatter"), small(result.center_scatter_rms_mm), small(two?.center_scatter_rms_mm), ""));
  rows.push(compareRow(t("evidence.left_out"), small(result.leave_one_out_surface_rms_mm), small(two?.leave_one_out_surface_rms_mm), ""));
  return rows;
}

/** @param {string} name @param {...string} cells */
function compareRow(name, ...cells) {
  return h("tr", {}, h("th", { scope: "row" }, name), ...cells.map((cell) => h("td", { class: "right" }, cell)));
}

/** @param {TcpResult} result */
function rawNumbers(result) {
  const rows = result.tool0_from_laser.map((row) => row.map((value) => value.toFixed(6).padStart(12)).join(" "));
  return h(
    "details", { class: "panel raw" },
    h("summary", {}, t("raw.title")),
    h("div", { class: "copy-row" }, h("pre", { tabindex: 0, "aria-label": t("raw.title") }, rows.join("\n")), copyButton(JSON.stringify(result.tool0_from_laser), t("raw.copy"))),
    h("p", { class: "soft small" }, icon("pass"), ` ${result.method} · ${result.software} · ${t("raw.inputs", { hash: result.inputs_sha256.slice(0, 12) })}`),
  );
}

/** @param {string} name @param {string} value */
function pair(name, value) {
  return h("div", {}, h("dt", {}, name), h("dd", {}, value));
}

/** @type {import("./index.js").StepPage} */
export const tcp = { summary, result: sections };
