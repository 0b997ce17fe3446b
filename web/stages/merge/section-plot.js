// A thin slice of the merged cloud in true proportion, and the colours of deviations.

import "../../texts/later.js";
import { s } from "../../dom.js";
import { fixed } from "../../format.js";
import { t } from "../../texts.js";

/** @import {CloudSection} from "../../state/model.js" */
/** @typedef {{ at: readonly [number, number] | null }} Aim */

/** Blue – grey – red, zero in the middle, as in the scene. */
const DIVERGING = [[20, 70, 190], [95, 145, 225], [172, 172, 172], [232, 125, 95], [190, 20, 35]];
const BINS = 9;
const ARROWS = /** @type {Readonly<Record<string, readonly [number, number]>>} */ ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] });
const KEY_STEPS = 60;
const SIZE = { width: 560, height: 360, margin: 34 };

/**
 * Between the ends of the scale; in bands at half and whole of a tolerance, where one is told.
 * @param {number} value @param {number} limit @param {number | null | undefined} tolerance
 */
function deviationColor(value, limit, tolerance) {
  const beyond = tolerance ? Number(Math.abs(value) > tolerance / 2) + Number(Math.abs(value) > tolerance) : 0;
  const share = tolerance ? (Math.sign(value) * beyond) / 2 : value / limit;
  const at = (Math.min(1, Math.max(-1, share)) + 1) * 2;
  const low = Math.min(3, Math.floor(at));
  const mix = (/** @type {number} */ channel) => Math.round((DIVERGING[low]?.[channel] ?? 0) * (low + 1 - at) + (DIVERGING[low + 1]?.[channel] ?? 0) * (at - low));
  return `rgb(${mix(0)} ${mix(1)} ${mix(2)})`;
}

/**
 * @param {CloudSection} section
 * @param {readonly (readonly number[])[]} picked points in the cloud's frame, mm
 * @param {(point: number[]) => void} pick a click, or Enter, picks the nearest point of the cloud
 * @param {Aim} aim where the arrow keys aim
 * @param {number | null | undefined} tolerance_mm
 */
export function sectionPlot(section, picked, pick, aim, tolerance_mm) {
  const { points, directions } = section;
  const along = (/** @type {readonly number[]} */ point, /** @type {number} */ which) => point.reduce((sum, value, axis) => sum + value * (directions[which]?.[axis] ?? 0), 0);
  const here = picked.filter((point) => Math.abs(along(point, 2) - section.at_mm) <= section.width_mm).map((point) => [along(point, 0), along(point, 1)]);
  const { low, high, across } = ends(section);
  const scale = Math.min((SIZE.width - 2 * SIZE.margin) / (high[0] - low[0] || 1), (SIZE.height - 2 * SIZE.margin) / (high[1] - low[1] || 1));
  const height = (high[1] - low[1]) * scale + 2 * SIZE.margin;
  const place = (/** @type {readonly number[]} */ [u = 0, v = 0]) => `${fixedPlain(SIZE.margin + (u - low[0]) * scale)} ${fixedPlain(height - SIZE.margin - (v - low[1]) * scale)}`;
  /** @type {Map<string, string[]>} */
  const dots = new Map();
  points.forEach((point, index) => {
    const color = colorOf(section, index, tolerance_mm);
    const list = dots.get(color) ?? [];
    list.push(`M${place(point)}h0`);
    dots.set(color, list);
  });
  const nearest = (/** @type {readonly [number, number]} */ at) => {
    const off = (/** @type {readonly number[]} */ [u = 0, v = 0]) => Math.hypot(u - at[0], v - at[1]);
    return points.reduce((best, one) => (off(one) < off(best) ? one : best), points[0] ?? at);
  };
  const take = (/** @type {readonly [number, number]} */ at) => {
    if (!points.length) return;
    const [u = 0, v = 0] = nearest(at);
    pick([0, 1, 2].map((axis) => [u, v, section.at_mm].reduce((sum, value, which) => sum + value * (directions[which]?.[axis] ?? 0), 0)));
  };
  const click = (/** @type {MouseEvent} */ event) => {
    const box = /** @type {Element} */ (event.currentTarget).getBoundingClientRect();
    const [x, y] = [((event.clientX - box.left) * SIZE.width) / box.width, ((event.clientY - box.top) * height) / box.height];
    take([low[0] + (x - SIZE.margin) / scale, low[1] + (height - SIZE.margin - y) / scale]);
  };
  const mark = s("path", { class: "aim" });
  const show = (at = aim.at) => at && mark.setAttribute("d", `M${place(nearest(at))}h0`);
  show();
  const key = (/** @type {KeyboardEvent} */ event) => {
    const [right = 0, up = 0] = ARROWS[event.key] ?? [];
    const [u, v] = aim.at ?? [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    const step = (high[0] - low[0]) / KEY_STEPS / (event.shiftKey ? 5 : 1);
    if (event.key === "Enter") take([u, v]);
    else if (event.key in ARROWS) show((aim.at = [u + right * step, v + up * step]));
    else return;
    event.preventDefault();
  };
  const lines = (section.nominal ?? []).map(([a, b, c, d]) => `M${place([a ?? 0, b ?? 0])}L${place([c ?? 0, d ?? 0])}`);
  const label = t("merged.section_label", { axis: section.axis ?? t("merged.plane_name"), at: fixed(section.at_mm, 1), points: section.count, u: across[0], v: across[1] });
  return s(
    "svg", { class: "section-plot picks", viewBox: `0 0 ${SIZE.width} ${fixedPlain(height)}`, role: "img", tabindex: 0, "aria-label": label, onclick: click, onkeydown: key },
    ...(lines.length ? [s("path", { class: "nominal", d: lines.join("") })] : []),
    ...[...dots].map(([color, list]) => s("path", { class: "dots", d: list.join(""), ...(color ? { stroke: color } : {}) })),
    ...(here.length === 2 ? [s("path", { class: "dimension", d: here.map((one, index) => `${index ? "L" : "M"}${place(one)}`).join("") })] : []),
    mark,
    ...here.map((one) => s("path", { class: "picked", d: `M${place(one)}h0` })),
    ...frame(section, scale, height),
  );
}

/** @param {CloudSection} section @param {number} index @param {number | null | undefined} tolerance */
function colorOf({ deviations_mm: deviations, limit_mm: limit }, index, tolerance) {
  const value = deviations?.[index];
  if (value === null || value === undefined || !limit) return "";
  return tolerance ? deviationColor(value, limit, tolerance) : deviationColor(Math.round((value / limit) * ((BINS - 1) / 2)), (BINS - 1) / 2, null);
}

/** Ends and names of both axes. @param {CloudSection} section */
function ends({ low_mm: [u0 = 0, v0 = 0], high_mm: [u1 = 1, v1 = 1], across: [u = "", v = ""] }) {
  return { low: /** @type {const} */ ([u0, v0]), high: /** @type {const} */ ([u1, v1]), across: /** @type {const} */ ([u, v]) };
}

/** Both axes with their ends. @param {CloudSection} section @param {number} scale @param {number} height */
function frame(section, scale, height) {
  const { low, high, across } = ends(section);
  const left = SIZE.margin;
  const bottom = height - SIZE.margin + 6;
  const right = left + (high[0] - low[0]) * scale;
  const tick = (/** @type {number} */ x, /** @type {number} */ y, /** @type {string} */ text, anchor = "middle") => s("text", { class: "tick", x, y, "text-anchor": anchor }, text);
  return [
    s("path", { class: "axis", d: `M${left} ${SIZE.margin}V${bottom}H${right}` }),
    tick(left, bottom + 14, fixed(low[0], 0)), tick(right, bottom + 14, `${fixed(high[0], 0)} mm`, "end"), tick((left + right) / 2, bottom + 14, across[0]),
    tick(left - 4, bottom - 6, fixed(low[1], 0), "end"), tick(left - 4, SIZE.margin + 4, fixed(high[1], 0), "end"), tick(left - 4, (SIZE.margin + bottom) / 2, across[1], "end"),
  ];
}

/** @param {number} value */
const fixedPlain = (value) => Number(value.toFixed(1));

/**
 * How many points lie how far off, as bars in the colours of the scene, between the ends of the tolerance.
 * @param {number[]} counts
 * @param {number} limit_mm
 * @param {number | null} [tolerance_mm]
 */
export function histogramPlot(counts, limit_mm, tolerance_mm) {
  const most = Math.max(...counts, 1);
  const width = 560 / counts.length;
  const middle = (counts.length - 1) / 2;
  return s(
    "svg", { class: "section-plot", viewBox: "0 0 560 96", role: "img", "aria-label": t("merged.histogram_label", { limit: fixed(limit_mm, 3) }) },
    ...counts.map((count, index) => s("rect", { x: index * width + 0.5, width: width - 1, y: 76 - (72 * count) / most, height: (72 * count) / most, fill: deviationColor(((index - middle) / middle) * limit_mm, limit_mm, tolerance_mm) })),
    s("path", { class: "axis", d: "M0 76.5H560M280 76V4" }),
    ...(tolerance_mm && tolerance_mm < limit_mm ? [s("path", { class: "limit", d: [-1, 1].map((side) => `M${fixedPlain(280 * (1 + (side * tolerance_mm) / limit_mm))} 76V2`).join("") })] : []),
    s("text", { class: "tick", x: 0, y: 91 }, `${fixed(-limit_mm, 3)} mm`), s("text", { class: "tick", x: 280, y: 91, "text-anchor": "middle" }, "0"),
    s("text", { class: "tick", x: 560, y: 91, "text-anchor": "end" }, `+${fixed(limit_mm, 3)} mm`),
  );
}
