// While frames of the board come in: where in the image and how near it was seen so far, and how sharp a frame is.

import { h, s } from "../dom.js";
import { fixed } from "../format.js";
import { t } from "../texts.js";

/** @import {CaptureOut} from "../state/model.js" */

const CELLS = /** @type {const} */ ([8, 6]);
const SHARPEST_PX = 1;
const SOFT_PX = 6; // as calib_core/captures/measure_frame.py
const SOFTEST_PX = 10;
const ENOUGH_DEPTH = 1.3;

/**
 * Where the board was seen in all frames of the shown one's step.
 * @param {readonly CaptureOut[]} captures
 * @param {CaptureOut} shown
 * @returns {HTMLElement[]}
 */
export function frameCoverage(captures, shown) {
  const size = shown.measured.image_size;
  if (!size) return [];
  const views = captures.filter((one) => one.step === shown.step && !one.excluded && (one.measured.board_px ?? []).length > 0);
  const [width, height] = size.map(Number);
  const points = views.flatMap((view) => (view.measured.board_px ?? []).map(([x, y]) => /** @type {const} */ ([x ?? 0, y ?? 0])));
  const share = covered(points, width ?? 1, height ?? 1);
  const pitches = views.map((view) => view.measured.pitch_px ?? 0).filter((pitch) => pitch > 0);
  const depth = pitches.length ? Math.max(...pitches) / Math.min(...pitches) : 1;
  const words = t(depth < ENOUGH_DEPTH ? "coverage.shallow" : "coverage.words", { frames: views.length, share: fixed(100 * share, 0), depth: fixed(depth, 1) });
  const dot = Math.max(width ?? 1, height ?? 1) / 110;
  return [h(
    "figure", { class: "seen-so-far" },
    s("svg", { class: "frame-plot", viewBox: `-0.5 -0.5 ${width} ${height}`, role: "img", "aria-label": words },
      s("path", { class: "found", "stroke-width": dot, d: points.map(([x, y]) => `M${x} ${y}h0`).join("") })),
    h("figcaption", { class: "small" }, h("strong", {}, t("coverage.title")), ` ${words}`),
  )];
}

/**
 * The share of the image's parts with a corner in them.
 * @param {readonly (readonly [number, number])[]} points
 * @param {number} width
 * @param {number} height
 */
function covered(points, width, height) {
  const [columns, rows] = CELLS;
  const place = (/** @type {number} */ at, /** @type {number} */ length, /** @type {number} */ count) => Math.min(count - 1, Math.max(0, Math.floor((at + 0.5) / length * count)));
  return new Set(points.map(([x, y]) => place(y, height, rows) * columns + place(x, width, columns))).size / (columns * rows);
}

/** A gauge of how narrow the edges are. @param {number} width_px */
export function sharpness(width_px) {
  const value = Math.min(Math.max(SOFTEST_PX - width_px, 0), SOFTEST_PX - SHARPEST_PX);
  return h("meter", { class: "sharpness", min: 0, max: SOFTEST_PX - SHARPEST_PX, low: SOFTEST_PX - SOFT_PX, optimum: SOFTEST_PX - SHARPEST_PX, value, "aria-label": t("quality.sharpness_label", { width: fixed(width_px, 1) }) });
}
