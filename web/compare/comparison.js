// Two results side by side: what was changed, how far the frames lie apart in units of their uncertainty and at the
// workpiece in mm, the figures, and the residuals.

import "../texts/later.js";
import { h } from "../dom.js";
import { fixed, integer, plusMinus, significant, small } from "../format.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";
import { bothAnswers } from "./answer-pair.js";
import { intervalPlot } from "./interval-plot.js";
import { plot } from "../result/plot.js";

/** @import {Change, Comparison, FrameDifference, RowDifference} from "../state/model.js" */

const RARE = 0.05;
/** Uncertainties are shown expanded. */
const K = 2;
/** The 95 % quantile of the distance of three independent standard normal numbers. */
const BAND = 2.795;

/**
 * @param {Comparison} comparison
 * @param {{ left: string, right: string }} names of the sides
 */
export function comparisonSections(comparison, names) {
  return [
    decision(comparison),
    bothAnswers(comparison),
    ...comparison.frames.map((frame) => frameSection(frame, comparison, names)),
    ...(comparison.maps ?? []).map((block) => panel(said(block.title ?? ""), h("p", { class: "soft small" }, said(block.caption)), plot({ ...block, kind: "plot" }))),
    changesSection(comparison),
    figuresSection(comparison, names),
    residualsSection(comparison, names),
  ].filter((section) => section !== null);
}

/** One sentence that decides. @param {Comparison} comparison */
function decision({ frames, left, right }) {
  if (!frames.length) return null;
  const apart = frames.filter(({ chance, distance }) => distance > 0 && chance < RARE);
  const worst = Math.max(...(apart.length ? apart : frames).map(({ at_workpiece_mm }) => at_workpiece_mm ?? 0));
  const failed = [left, right].filter(({ verdict }) => verdict === "fail").length;
  const words = failed === 2 ? t("comparison.decide_none") : failed === 1 ? t(left.verdict === "fail" ? "comparison.decide_second" : "comparison.decide_first")
    : apart.length ? t("comparison.decide_apart", { distance: small(worst) }) : t("comparison.decide_either", { distance: small(worst) });
  return h("p", { class: "decision" }, mark(failed ? "fail" : apart.length ? "warn" : "pass", words));
}

/** @param {string} title @param {...(Node | string | null | false)} parts */
function panel(title, ...parts) {
  return h("section", { class: "panel", "aria-label": title }, h("h2", {}, title), ...parts.filter((part) => part));
}

/** @param {string[]} heads */
function head(...heads) {
  return h("thead", {}, h("tr", {}, ...heads.map((text, index) => h("th", { scope: "col", class: index > 0 && "right" }, text))));
}

/** @param {string} name @param {...(string | Node)} cells */
function line(name, ...cells) {
  return h("tr", {}, h("th", { scope: "row" }, name), ...cells.map((cell) => h("td", { class: "right" }, cell)));
}

/** @param {FrameDifference} frame @param {Comparison} comparison @param {{ left: string, right: string }} names */
function frameSection(frame, { shared }, names) {
  const far = frame.chance < RARE;
  const same = frame.distance === 0;
  const verdict = same ? "pass" : far ? "warn" : "pass";
  const rows = frame.axes.map((axis) => line(
    maybe(`comparison.axis_${axis.axis}`, axis.axis), signed(axis.difference, axis.sigma * K, axis.unit), plusMinusOr(axis.sigma * K, axis.unit),
    typeof axis.sigmas === "number" ? `${fixed(axis.sigmas, 1)} σ` : "–"));
  return panel(
    t("comparison.frame", { frame: maybe(`comparison.${frame.frame}`, frame.frame) }),
    h("p", {}, mark(verdict, same ? t("comparison.same") : t(far ? "comparison.apart" : "comparison.agree", {
      distance: fixed(frame.distance, 1), freedom: frame.degrees_of_freedom, chance: chanceWords(frame.chance),
    }))),
    frame.frame !== "camera_from_laser" && h("p", { class: "workpiece" }, t("comparison.at_workpiece", {
      distance: small(frame.at_workpiece_mm), sigma: small(frame.at_workpiece_sigma_mm * K),
    })),
    !same && intervalPlot(frame),
    h("table", { class: "number compare" },
      head(t("compare.what"), t("comparison.difference", names), t("comparison.combined"), t("comparison.in_sigmas")), h("tbody", {}, ...rows)),
    h("p", { class: "soft small" }, shared ? t("comparison.shared", { shared }) : t("comparison.independent")),
  );
}

/** @param {number} chance */
function chanceWords(chance) {
  return chance < 0.001 ? t("comparison.tiny") : `${significant(chance * 100, 2)} %`;
}

/** @param {number} value @param {number} uncertainty @param {"deg" | "mm"} unit */
function signed(value, uncertainty, unit) {
  const digits = uncertainty > 0 ? Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(uncertainty)))) : 4;
  return `${value > 0 ? "+" : ""}${fixed(value, digits)}${unit === "deg" ? "°" : " mm"}`;
}

/** @param {number} uncertainty @param {"deg" | "mm"} unit */
function plusMinusOr(uncertainty, unit) {
  return uncertainty > 0 ? plusMinus(uncertainty, unit === "deg" ? "°" : "mm") : "–";
}

/** @param {Comparison} comparison */
function changesSection({ changes, left, right }) {
  const about = [];
  if (left.software !== right.software) about.push(t("comparison.software", { left: left.software, right: right.software }));
  if (left.method !== right.method) about.push(t("comparison.method", { left: left.method, right: right.method }));
  if (left.session !== right.session && !changes?.length) return about.length ? panel(t("comparison.changes"), list(about)) : null;
  const words = changes ? grouped(changes) : [];
  const nothing = !words.length && !about.length;
  return panel(
    t("comparison.changes"),
    changes === null && h("p", { class: "soft" }, t("comparison.unknown")),
    nothing && changes !== null && h("p", { class: "soft" }, t("comparison.nothing")),
    list([...about, ...words]),
  );
}

/** One line for what was done to several captures alike; long lists of changed values open on demand. @param {readonly Change[]} changes @returns {(string | Node)[]} */
function grouped(changes) {
  return [...new Set(changes.map(({ kind }) => kind))].flatMap(groupOf);

  /** @param {Change["kind"]} kind @returns {(string | Node)[]} */
  function groupOf(kind) {
    const some = changes.filter((change) => change.kind === kind);
    if (kind === "cell" || some.length === 1) return some.map(changeWords);
    const what = some.map((change) => change.what).join(", ");
    if (kind !== "changed" && kind !== "file") return [t(`change.${kind}_many`, { count: some.length, what })];
    return [h("details", {}, h("summary", {}, t(`change.${kind}_many`, { count: some.length })), list(some.map(changeWords)))];
  }
}

/** @param {(string | Node)[]} sentences */
function list(sentences) {
  return h("ul", { class: "changes" }, ...sentences.map((sentence) => h("li", {}, sentence)));
}

/** @param {Change} change */
function changeWords({ kind, what, left = "", right = "" }) {
  return t(/** @type {"change.cell"} */ (`change.${kind}`), { what, left, right });
}

/** @param {Comparison} comparison @param {{ left: string, right: string }} names */
function figuresSection({ figures, left, right }, names) {
  const rows = figures.filter((one) => typeof one.left === "number" || typeof one.right === "number").map((one) => {
    const { words, unit } = named(one.name);
    const show = (/** @type {number | null | undefined} */ value) => (typeof value === "number" ? `${Number.isInteger(value) && !unit ? integer(value) : significant(value, 4)}${unit}` : "–");
    const difference = typeof one.left === "number" && typeof one.right === "number" ? one.right - one.left : null;
    return line(words, show(one.left), show(one.right), difference === null ? "–" : difference === 0 ? "0" : `${difference > 0 ? "+" : ""}${significant(difference, 2)}${unit}`);
  });
  return panel(
    t("comparison.figures"),
    h("table", { class: "number compare" }, head(t("compare.what"), names.left, names.right, t("compare.difference")),
      h("tbody", {}, line(t("result.verdict"), verdict(left.verdict), verdict(right.verdict), ""), ...rows)));
}

/** @param {string} one */
const verdict = (one) => mark(one, maybe(`verdict.${one}`, one));

/** @param {string} name of a record's field, whose ending is its unit */
function named(name) {
  const unit = /** @type {const} */ ([["_mm", "\u202fmm"], ["_deg", "°"], ["_rad", "\u202frad"], ["_px", "\u202fpx"]]).find(([ending]) => name.endsWith(ending));
  const bare = unit ? name.slice(0, -unit[0].length) : name;
  return { words: maybe(`figure.${name}`, bare.replaceAll("_", " ")), unit: unit?.[1] ?? "" };
}

/** @param {Comparison} comparison @param {{ left: string, right: string }} names */
function residualsSection({ residuals }, names) {
  if (!residuals.length) return null;
  const figure = ["mahalanobis", "rms_px", "line_rms_mm"].find((one) => residuals.some((row) => typeof row.left?.[one] === "number")) ?? "mahalanobis";
  const show = (/** @type {RowDifference} */ row, /** @type {"left" | "right"} */ side) => {
    const used = side === "left" ? row.left_used : row.right_used;
    if (used === null || used === undefined) return t("comparison.absent");
    const value = row[side]?.[figure];
    const words = typeof value === "number" ? valueWords(figure, value) : "–";
    const reason = side === "left" ? row.left_reason : row.right_reason;
    return used ? words : h("span", { title: said(reason ?? "") }, `${words} `, mark("fail", t("captures.rejected")));
  };
  return panel(
    t("comparison.residuals"),
    h("p", { class: "soft small" }, t(figure === "mahalanobis" ? "comparison.residuals_what" : "comparison.residuals_plain")),
    figure === "mahalanobis" && pairPlot(residuals, names),
    h("table", { class: "number compare" }, head(t("column.id"), names.left, names.right),
      h("tbody", {}, ...residuals.map((row) => line(row.capture, show(row, "left"), show(row, "right"))))),
  );
}

/** @param {string} figure @param {number} value */
function valueWords(figure, value) {
  if (figure === "mahalanobis") return `${fixed(value, 1)} σ`;
  return figure === "rms_px" ? `${fixed(value, 3)} px` : small(value);
}

/** @param {RowDifference[]} rows @param {{ left: string, right: string }} names */
function pairPlot(rows, names) {
  const series = /** @type {const} */ (["left", "right"]).map((side) => ({
    label: names[side], captures: rows.map(({ capture }) => capture),
    y: rows.map((row) => { const value = row[side]?.["mahalanobis"]; return typeof value === "number" ? value : null; }),
    reasons: rows.map((row) => (side === "left" ? row.left_used : row.right_used) === false ? (side === "left" ? row.left_reason : row.right_reason) ?? t("captures.rejected") : null),
  }));
  return plot({ kind: "plot", shape: "captures", caption: t("comparison.plot", names), x: { label: t("column.id") }, y: { label: t("comparison.in_sigmas"), low: 0, unit: "σ" }, series, band: { low: 0, high: BAND, label: t("comparison.band") } });
}
