// While frames of the board come in: where in the image and how near it was seen so far, and how sharp a frame is.

import { h, s } from "../dom.js";
import { fixed } from "../format.js";
import { plural, t } from "../texts.js";

/** @import {CaptureOut} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const SHARPEST_PX = 1;
const SOFT_PX = 6; // as calib_core/captures/measure_frame.py
const SOFTEST_PX = 10;

/**
 * Where the board was seen in all frames of the shown one's step, as the guide counts it.
 * @param {SessionState} state
 * @param {CaptureOut} shown
 * @returns {HTMLElement[]}
 */
export function frameCoverage({ captures, guide }, shown) {
  const seen = guide?.coverage?.find(({ step }) => step === shown.step);
  if (!seen || !shown.measured.image_size) return [];
  const views = captures.filter((one) => one.step === shown.step && !one.excluded && one.measured.verdict !== "fail");
  const [width = 1, height = 1] = shown.measured.image_size.map(Number);
  const [one, many] = seen.one_distance ? /** @type {const} */ (["coverage.shallow_one", "coverage.shallow_many"]) : /** @type {const} */ (["coverage.words_one", "coverage.words_many"]);
  const words = plural(seen.frames, one, many, { share: fixed(100 * seen.covered, 0), depth: fixed(seen.depth_ratio, 1) });
  return [h(
    "figure", { class: "seen-so-far" },
    s("svg", { class: "frame-plot", viewBox: `-0.5 -0.5 ${width} ${height}`, role: "img", "aria-label": words },
      s("path", { class: "found", "stroke-width": Math.max(width, height) / 110, d: views.flatMap((view) => view.measured.board_px ?? []).map(([x, y]) => `M${x} ${y}h0`).join("") })),
    ...tilts(seen.facing ?? []),
    h("figcaption", { class: "small" }, h("strong", {}, t("coverage.title")), ` ${words}`),
  )];
}

/**
 * Which way the boards faced so far, squarely in the middle, and a larger dot the nearer; rings at 20 and 40°.
 * @param {import("../state/model.js").BoardFacing[]} facing
 */
function tilts(facing) {
  if (!facing.length) return [];
  const degrees = facing.map(({ facing_rad }) => facing_rad.map((angle) => Number(angle) * 180 / Math.PI));
  const largest = Math.max(...degrees.map(([x = 0, y = 0]) => Math.hypot(x, y)));
  return [s("svg", { class: "tilts-plot", viewBox: "-60 -60 120 120", role: "img", "aria-label": t("coverage.tilts", { most: fixed(largest, 0) }) },
    s("path", { class: "ring", d: "M-60 0h120M0-60v120" }),
    ...[20, 40].flatMap((ring) => [s("circle", { class: "ring", r: ring }), s("text", { x: 1, y: -ring - 1 }, `${ring}°`)]),
    ...facing.map(({ nearness }, k) => s("circle", { class: "dot", cx: degrees[k]?.[0], cy: degrees[k]?.[1], r: 1.5 + 3 * nearness })))];
}

/** A gauge of how narrow the edges are. @param {number} width_px */
export function sharpness(width_px) {
  const value = Math.min(Math.max(SOFTEST_PX - width_px, 0), SOFTEST_PX - SHARPEST_PX);
  return h("meter", { class: "sharpness", min: 0, max: SOFTEST_PX - SHARPEST_PX, low: SOFTEST_PX - SOFT_PX, optimum: SOFTEST_PX - SHARPEST_PX, value, "aria-label": t("quality.sharpness_label", { width: fixed(width_px, 1) }) });
}
