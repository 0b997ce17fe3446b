// Residuals of a view of the board as arrows on the frame, so much longer than they are that they are seen.

import { s } from "../dom.js";

/** @import {CameraResult} from "../state/model.js" */
/** @typedef {CameraResult["residuals"][number]} View */

/** How many times as long as they are: the most that leaves them short beside the frame. @param {CameraResult} result */
export function timesLonger({ image_size, reprojection_rms_px }) {
  const [width = 1, height = 1] = image_size.map(Number);
  return 10 ** Math.max(0, Math.floor(Math.log10(Math.max(width, height) / 12 / Math.max(3 * reprojection_rms_px, 1e-3))));
}

/** Arrows and corners, to be put over a frame or on nothing. @param {readonly View[]} views @param {number} size of the frame @param {number} times */
export function arrowsOn(views, size, times) {
  const path = views.map(({ points_px: points = [], residuals_px: residuals = [] }) => points.map(([x, y], index) =>
    `M${x} ${y}l${((residuals[index]?.[0] ?? 0) * times).toFixed(1)} ${((residuals[index]?.[1] ?? 0) * times).toFixed(1)}`).join("")).join("");
  const corners = views.map(({ points_px: points = [] }) => points.map(([x, y]) => `M${x} ${y}h0`).join("")).join("");
  return [s("path", { class: "arrow", "stroke-width": size / 330, d: path }), s("path", { class: "corner", "stroke-width": size / 140, d: corners })];
}
