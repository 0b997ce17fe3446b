// The merged cloud: how far overlapping scans lie apart beside what was expected, what became of each scan, the files.

import { api } from "../api.js";
import { mergeSettings } from "../components/merge-settings.js";
import { h, make } from "../dom.js";
import { fixed, integer, significant, small } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { banner, pair, verdictWord } from "./parts.js";

/** @import {MergeResidual, MergeResult, StageResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */

const OF_CLOUD = /** @type {const} */ (["ply", "pcd", "xyz", "e57"]);
const OF_MESH = /** @type {const} */ (["ply", "stl"]);

/** @param {MergeResult} result */
function summary(result) {
  return [h(
    "div", { class: "answer" },
    h("h3", {}, t("step.merge"), " ", mark(result.stale ? "stale" : result.verdict, verdictWord(result))),
    h("p", { class: "number" }, t("merge.points", { points: integer(result.points) })),
    result.overlap_rms_mm !== null && h("p", { class: "small soft" }, t("merge.apart_short", { apart: small(result.overlap_rms_mm), expected: small(result.expected_overlap_rms_mm) })),
  )];
}

/** @param {MergeResult} result @param {SessionState} state */
function sections(result, state) {
  const past = "timeline" in state; // the stored cloud is that of the latest merge
  return [
    banner(result, t("step.merge"), t("merge.pass_words")),
    h("div", { class: "result-pair" }, figures(result), past ? null : files(result, state, mergeSettings(state))),
    result.cloud && !past ? lookInto(state) : null,
    scans(result),
    h("p", { class: "soft small" }, `${result.method} · ${result.software} · ${t("raw.inputs", { hash: result.inputs_sha256.slice(0, 12) })}`),
  ];
}

/** Sections and deviations are fetched once somebody looks at a merged cloud. @param {SessionState} state */
function lookInto(state) {
  const place = h("div");
  void import("../components/merged.js").then(({ MergedElement }) => place.replaceWith(make(MergedElement, { state })));
  return place;
}

/** @param {MergeResult} result */
function figures(result) {
  const size = result.high_mm.map((high, axis) => fixed(high - (result.low_mm[axis] ?? 0), 1)).join(" × ");
  return h(
    "section", { class: "panel", "aria-labelledby": "merge-title" },
    h("h2", { id: "merge-title" }, t("merge.apart")),
    h("dl", { class: "pairs number" },
      pair(t("merge.measured"), small(result.overlap_rms_mm)),
      pair(t("merge.expected"), small(result.expected_overlap_rms_mm)),
      result.registered_overlap_rms_mm !== null && result.registered_overlap_rms_mm !== undefined && pair(t("merge.registered"), small(result.registered_overlap_rms_mm)),
      pair(t("merge.pairs"), integer(result.overlap_pairs)),
      result.self_calibration && pair(t("merge.improved"), integer(result.self_calibration.directions)),
    ),
    h("p", { class: "soft small" }, t("merge.apart_what")),
    h("h3", {}, t("merge.cloud")),
    h("dl", { class: "pairs number" },
      pair(t("quality.points"), t("merge.of", { part: integer(result.points), all: integer(result.scanned_points) })),
      pair(t("merge.voxel"), `${fixed(result.voxel_mm, 2)} mm`),
      pair(t("merge.size"), `${size} mm`),
      pair(t("merge.triangles"), result.mesh ? integer(result.triangles ?? 0) : "–"),
    ),
  );
}

/** @param {MergeResult} result @param {SessionState} state @param {HTMLElement} settings */
function files(result, state, settings) {
  const link = (/** @type {string} */ stem, /** @type {string} */ format) =>
    h("a", { class: "file", href: api.cloudAddress(state.id, `${stem}.${format}`), download: `${state.id}-${stem}.${format}` }, format.toUpperCase());
  const row = (/** @type {string} */ name, /** @type {string} */ stem, /** @type {readonly string[]} */ formats) =>
    h("div", { class: "files-row" }, h("h3", {}, name), ...formats.map((format) => link(stem, format)));
  return h(
    "section", { class: "panel", "aria-labelledby": "merge-files" },
    h("h2", { id: "merge-files" }, t("merge.files")),
    result.cloud ? row(t("merge.cloud"), "merged", OF_CLOUD) : h("p", {}, t("merge.no_cloud")),
    result.mesh && row(t("merge.mesh"), "mesh", OF_MESH),
    h("p", { class: "soft small" }, t(result.frame === "turntable" ? "merge.in_table" : "merge.in_base"), " ", t("merge.units")),
    settings,
  );
}

/** @param {MergeResult} result */
function scans(result) {
  const moved = result.residuals.some((row) => typeof row.shift_mm === "number");
  const heads = /** @type {("scan" | "kept" | "stray" | "mixed" | "grazing" | "off" | "expected_short" | "shift")[]} */ (["scan", "kept", "stray", "mixed", "grazing", "off", "expected_short", ...(moved ? ["shift"] : [])]);
  return h(
    "section", { class: "panel", "aria-labelledby": "merge-scans" },
    h("h2", { id: "merge-scans" }, t("merge.each")),
    h("div", { class: "wide-table", role: "group", tabindex: 0, "aria-labelledby": "merge-scans" },
      h("table", { class: "number compare" },
        h("thead", {}, h("tr", {}, ...heads.map((head, index) => h("th", { scope: "col", class: index > 0 && "right" }, t(`merge.${head}`))))),
        h("tbody", {}, ...result.residuals.map((row) => scanRow(row, moved))))),
    h("p", { class: "soft small" }, t("merge.each_what")),
  );
}

/** @param {MergeResidual} row @param {boolean} moved whether registration moved the scans */
function scanRow(row, moved) {
  const share = (/** @type {number | undefined} */ count) => h("td", { class: "right" }, row.points ? `${fixed((100 * (count ?? 0)) / row.points, 1)} %` : "–");
  const name = h("th", { scope: "row" }, row.capture);
  if (!row.used) return h("tr", {}, name, h("td", { colspan: moved ? 7 : 6 }, mark("warn", row.reason ?? t("captures.rejected"))));
  return h("tr", {}, name,
    h("td", { class: "right" }, row.points ? t("merge.of", { part: integer(row.kept ?? 0), all: integer(row.points) }) : "–"),
    share(row.stray), share(row.mixed), share(row.grazing),
    h("td", { class: "right" }, small(row.overlap_rms_mm)), h("td", { class: "right" }, small(row.expected_overlap_rms_mm)),
    moved && h("td", { class: "right" }, typeof row.shift_mm === "number" ? t("merge.moved", { shift: small(row.shift_mm), turn: significant(row.turn_deg ?? 0, 2) }) : "–"));
}

/** @type {import("./index.js").StepPage} */
export const merge = {
  summary: (result) => summary(/** @type {MergeResult} */ (result)),
  result: (/** @type {StageResult} */ result, state) => sections(/** @type {MergeResult} */ (result), state),
};
