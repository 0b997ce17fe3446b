// What the results of several steps share: verdict, frame as the controller wants it, rows of figures, raw numbers.

import { api } from "../api.js";
import { h } from "../dom.js";
import { decimalsForAll, fixed, measured } from "../format.js";
import { icon, mark } from "../icons.js";
import { maybe, t } from "../texts.js";
import { copyButton } from "../components/copy.js";

/** @import {AtWorkpiece, PoseConvention, StageResult, ToolNumbers} from "../model.js" */
/** @import {SessionState} from "../state.js" */

/** Every ± of the page is at this coverage factor. */
export const K = 2;

/** @param {StageResult} result */
export function verdictWord(result) {
  return result.stale ? t("result.stale") : maybe(`verdict.${result.verdict}`, result.verdict);
}

/**
 * The verdict, what is open, the warnings, and which captures were left out and why.
 * @param {StageResult} result
 * @param {string} [name] of the stage
 * @param {string} [good] what an accepted result of this stage means
 */
export function banner(result, name, good = t("verdict.pass_words")) {
  const verdict = result.stale ? "stale" : result.verdict;
  const words = result.stale ? t("result.stale_words") : result.verdict === "pass" ? good : t(`verdict.${result.verdict}_words`);
  const open = "undetermined" in result ? result.undetermined ?? [] : [];
  return h(
    "section", { class: `banner banner-${verdict}`, "aria-label": t("result.verdict") },
    h("h2", {}, name && `${name} `, mark(verdict, verdictWord(result)), " ", h("span", { class: "words" }, words)),
    ...open.map((one) => h("p", {}, mark("warn", one.description))),
    ...list(result.warnings ?? []),
    ...list(result.residuals.flatMap((row) => (row.used || !row.reason ? [] : [`${row.capture}: ${row.reason}`]))),
  );
}

/** @param {string[]} sentences */
function list(sentences) {
  return sentences.length ? [h("ul", {}, ...sentences.map((sentence) => h("li", {}, sentence)))] : [];
}

/**
 * @typedef {object} Frame
 * @property {string} id of the panel, unique in the page
 * @property {string} title
 * @property {"frame.what" | "table.frame_what"} what
 * @property {number[][]} matrix
 * @property {number[]} sigmas_mm of the translation, where the controllers' numbers are not there
 * @property {Record<PoseConvention, ToolNumbers> | undefined} written by convention
 */

/**
 * A frame as the controller wants it typed in, each number with its own uncertainty.
 * @param {SessionState} state
 * @param {Frame} frame
 */
export function framePanel(state, frame) {
  const { convention, names, numbers, sigmas, text } = inConvention(state, frame);
  return h(
    "section", { class: "panel frame", "aria-labelledby": `${frame.id}-title` },
    h("div", { class: "row spread" }, h("h2", { id: `${frame.id}-title` }, frame.title), copyButton(text, t("frame.copy"))),
    h("p", { class: "soft small" }, t(frame.what, { convention: maybe(`convention.${convention}`, convention) })),
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
    state.tool && h("p", { class: "small" }, h("a", { href: api.exportAddress(state.id, "json"), download: `${state.id}-tool.json` }, t("frame.export"))),
  );
}

/**
 * The frame's numbers in the cell's convention; a matrix is read by its translation.
 * @param {SessionState} state
 * @param {Frame} frame
 */
function inConvention(state, { matrix, sigmas_mm, written }) {
  const convention = state.tool?.pose_convention ?? "matrix";
  const found = written?.[convention];
  const all = found?.numbers ?? matrix.flat();
  const text = all.map((number) => String(Number(number.toFixed(6)))).join(" ");
  if (!found || convention === "matrix") {
    const numbers = matrix.slice(0, 3).map((row) => row[3] ?? 0);
    return { convention: /** @type {PoseConvention} */ ("matrix"), names: ["x", "y", "z"], numbers, sigmas: sigmas_mm, text };
  }
  return { convention, names: found.names, numbers: found.numbers, sigmas: found.standard_deviations, text };
}

/** @param {string} name @param {string} convention */
function unitOf(name, convention) {
  if (/^q|^[xyz]?w$/.test(name)) return "";
  if (/^[xyz]$/i.test(name)) return convention === "ur" || convention === "ros" ? "m" : "mm";
  return convention === "ur" ? "rad" : "°";
}

/**
 * What the uncertainty means where it matters: how far off a point of the workpiece may lie.
 * @param {StageResult} result
 */
export function workpiecePanel({ at_workpiece: rows = [] }) {
  if (!rows.length) return null;
  const digits = (/** @type {AtWorkpiece} */ row) => decimalsForAll(row.sigmas_mm.map((sigma) => sigma * K));
  return h(
    "section", { class: "panel", "aria-labelledby": "workpiece-title" },
    h("h2", { id: "workpiece-title" }, t("workpiece.title")),
    h("p", { class: "soft small" }, t("workpiece.what")),
    h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...["by", "x", "y", "z", "worst"].map((head, index) => h("th", { scope: "col", class: index > 0 && "right" }, t(/** @type {"workpiece.by"} */ (`workpiece.${head}`)))))),
      h("tbody", {}, ...rows.map((row) => h("tr", {},
        h("th", { scope: "row" }, t(/** @type {"workpiece.tool"} */ (`workpiece.${row.of}`), { mount: row.where ?? "" }), h("br"),
          h("span", { class: "soft" }, t("workpiece.at", { point: row.point_mm.map((value) => fixed(value, 0)).join(", ") }))),
        ...row.sigmas_mm.map((sigma) => h("td", { class: "right" }, `±${fixed(sigma * K, digits(row))} mm`)),
        h("td", { class: "right" }, `±${fixed(row.worst_sigma_mm * K, digits(row))} mm`))))),
  );
}

/** @param {string} name @param {...string} cells */
export function compareRow(name, ...cells) {
  return h("tr", {}, h("th", { scope: "row" }, name), ...cells.map((cell) => h("td", { class: "right" }, cell)));
}

/**
 * @param {StageResult} result
 * @param {number[][]} matrix
 * @param {string} [title]
 */
export function rawNumbers(result, matrix, title = t("raw.title")) {
  const rows = matrix.map((row) => row.map((value) => value.toFixed(6).padStart(12)).join(" "));
  return h(
    "details", { class: "panel raw" },
    h("summary", {}, title),
    h("div", { class: "copy-row" }, h("pre", { tabindex: 0, "aria-label": title }, rows.join("\n")), copyButton(JSON.stringify(matrix), t("raw.copy"))),
    h("p", { class: "soft small" }, icon("pass"), ` ${result.method} · ${result.software} · ${t("raw.inputs", { hash: result.inputs_sha256.slice(0, 12) })}`),
  );
}

/** @param {string} name @param {string} value */
export function pair(name, value) {
  return h("div", {}, h("dt", {}, name), h("dd", {}, value));
}
