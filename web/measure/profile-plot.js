// A profile as it was measured, with the arc that was found in it. Equal scale in both axes.

import { h, s } from "../dom.js";
import { fixed } from "../format.js";
import { t } from "../texts.js";

/** @import {Measured} from "../state/model.js" */
/** @typedef {{ left: number, right: number, low: number, high: number }} Frame */

const STEPS = [1, 2, 5];

/**
 * Points to draw: [x, z] of the plane of light; a cloud is seen from the side.
 * @param {Measured} measured
 * @returns {[number, number][]}
 */
function flat(measured) {
  return (measured.preview ?? []).map((row) => [row[0] ?? 0, row.at(-1) ?? 0]);
}

/**
 * The part to look at: the sphere's circle and some surroundings, in the shape of the canvas.
 * @param {[number, number][]} points
 * @param {Measured} measured
 * @param {number} aspect
 * @returns {Frame}
 */
function frame(points, measured, aspect) {
  const center = measured.center_mm;
  const radius = measured.radius_mm;
  let xs = points.map((point) => point[0]);
  let zs = points.map((point) => point[1]);
  if (center && radius) {
    const x = center[0] ?? 0;
    const z = center.at(-1) ?? 0;
    xs = [x - 1.7 * radius, x + 1.7 * radius];
    zs = [z - 1.2 * radius, z + 1.2 * radius];
  }
  let left = Math.min(...xs), right = Math.max(...xs), low = Math.min(...zs), high = Math.max(...zs);
  const width = Math.max(right - left, (high - low) * aspect, 1) * 1.04;
  const height = width / aspect;
  const middle = [(left + right) / 2, (low + high) / 2];
  [left, right] = [(middle[0] ?? 0) - width / 2, (middle[0] ?? 0) + width / 2];
  [low, high] = [(middle[1] ?? 0) - height / 2, (middle[1] ?? 0) + height / 2];
  return { left, right, low, high };
}

/**
 * @param {Measured} measured
 * @param {{ width: number, height: number, scale?: boolean, most?: number }} size `most`: points to draw at most
 * @returns {SVGSVGElement}
 */
export function profilePlot(measured, { width, height, scale = true, most = 2000 }) {
  const points = flat(measured);
  const root = s("svg", { class: "profile-plot", viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label(measured) });
  if (!points.length) return root;
  const view = frame(points, measured, width / height);
  const unit = width / (view.right - view.left);
  // z grows away from the scanner: the scanner is above the picture unless its z counts toward itself.
  const place = (/** @type {number} */ x, /** @type {number} */ z) =>
    `${((x - view.left) * unit).toFixed(1)} ${((z - view.low) * unit).toFixed(1)}`;
  const on = measured.preview_on_sphere ?? [];
  const step = Math.ceil(points.length / most);
  for (const kind of [false, true]) {
    const path = points.flatMap(([x, z], index) =>
      index % step === 0 && (on[index] ?? false) === kind && inside(view, x, z) ? [`M${place(x, z)}h0`] : []);
    if (path.length) root.append(s("path", { class: kind ? "point on" : "point", d: path.join("") }));
  }
  const { center_mm: center, radius_mm: radius } = measured;
  if (center && radius && measured.kind !== "center") {
    const [cx, cy] = place(center[0] ?? 0, center.at(-1) ?? 0).split(" ");
    root.prepend(s("circle", { class: "fit", cx, cy, r: (radius * unit).toFixed(1) }));
  }
  if (scale) root.append(...scaleBar(view, unit, width, height));
  return root;
}

/**
 * @param {Frame} view
 * @param {number} x
 * @param {number} z
 */
function inside(view, x, z) {
  return x >= view.left && x <= view.right && z >= view.low && z <= view.high;
}

/**
 * @param {Frame} view
 * @param {number} unit
 * @param {number} width
 * @param {number} height
 */
function scaleBar(view, unit, width, height) {
  const wanted = (view.right - view.left) / 5;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const length = power * (STEPS.filter((step) => step * power <= wanted).at(-1) ?? 1);
  const end = width - 12;
  return [
    s("path", { class: "scale", d: `M${(end - length * unit).toFixed(1)} ${height - 10}H${end}m0 -3v6M${(end - length * unit).toFixed(1)} ${height - 13}v6` }),
    s("text", { class: "scale-text", x: end - (length * unit) / 2, y: height - 16, "text-anchor": "middle" }, `${fixed(length, power < 1 ? 1 : 0)} mm`),
  ];
}

/** @param {Measured} measured */
function label(measured) {
  return t("plot.profile", { capture: measured.capture, points: measured.points ?? 0 });
}

/**
 * Where r/R lies in the useful zone.
 * @param {number} zone
 */
export function zoneBar(zone) {
  const shown = Math.min(Math.max(zone, 0), 1.05);
  const good = zone >= 0.45 && zone <= 0.95;
  return h(
    "div", { class: "zone", role: "img", "aria-label": t(good ? "zone.good" : "zone.bad", { zone: fixed(zone, 2) }) },
    h("span", { class: "zone-useful" }),
    h("span", { class: good ? "zone-mark" : "zone-mark off", style: `left: ${(shown / 1.05) * 100}%` }),
  );
}
