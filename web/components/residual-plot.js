// One dot a capture: how far it lies from what the others expect, in units of that expectation's own uncertainty.
// The band holds 95 % of good captures; rejected ones are crossed.

import { h, s } from "../dom.js";
import { fixed, small } from "../format.js";
import { t } from "../texts.js";

/** @import {ChainResult, Residual, TcpResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */

const WIDTH = 560;
const HEIGHT = 184;
const LEFT = 48;
const BOTTOM = 26;
const TOP = 16;
/** The 95 % quantile of the distance of three independent standard normal numbers. */
export const BAND = 2.795;
const LEAST_TOP = 4;

/**
 * @typedef {object} Scale
 * @property {number} top largest value that is drawn where it is; what lies beyond is drawn at the edge with a sign
 * @property {number} width
 * @property {(index: number) => number} x
 * @property {(value: number) => number} y
 */

/**
 * @param {TcpResult | ChainResult} result
 * @param {SessionState} state
 * @param {Record<string, number>} [turned_deg] by capture: the plot is then against the flange's orientation
 */
export function residualPlot(result, state, turned_deg) {
  const rows = turned_deg ? result.residuals.filter((row) => row.capture in turned_deg) : result.residuals;
  const drawn = rows.filter((row) => typeof row.mahalanobis === "number");
  if (!drawn.length) return h("p", { class: "soft" }, t("residuals.none"));
  const scale = turned_deg ? byTurn(scaleOf(rows), rows, turned_deg) : scaleOf(rows);
  const root = s(
    "svg", { class: "residual-plot", viewBox: `0 0 ${scale.width} ${HEIGHT}`, style: `max-width: ${scale.width}px`, role: "group", "aria-label": t(turned_deg ? "residuals.turn_label" : "residuals.label") },
    s("rect", { class: "band", x: LEFT, y: scale.y(BAND), width: scale.width - LEFT, height: scale.y(0) - scale.y(BAND) }),
    ...axis(scale),
    ...(turned_deg ? turnLabels(scale) : rows.flatMap((row, index) => labelOf(row, index, rows.length, scale))),
    ...rows.flatMap((row, index) => dot(row, scale.x(index), scale, state)),
  );
  return h("div", { class: "plot-holder" }, root, legend(rows.some((row) => !row.used)));
}

/** @param {Residual[]} rows @returns {Scale} */
function scaleOf(rows) {
  const used = rows.filter((row) => row.used).map((row) => row.mahalanobis ?? 0);
  const top = Math.max(LEAST_TOP, Math.ceil(Math.max(...used, 0) + 0.5));
  const width = Math.max(WIDTH, LEFT + rows.length * 14);
  return {
    top, width,
    x: (index) => LEFT + ((index + 0.5) * (width - LEFT)) / rows.length,
    y: (value) => TOP + (HEIGHT - TOP - BOTTOM) * (1 - Math.min(value / top, 1)),
  };
}

/**
 * The same scale with captures where their orientation puts them.
 * @param {Scale} scale
 * @param {Residual[]} rows
 * @param {Record<string, number>} turned_deg
 * @returns {Scale & { most: number }}
 */
function byTurn(scale, rows, turned_deg) {
  const most = Math.max(10, ...rows.map((row) => turned_deg[row.capture] ?? 0));
  const x = (/** @type {number} */ degrees) => LEFT + 12 + (degrees / most) * (WIDTH - LEFT - 24);
  return { ...scale, most, width: WIDTH, x: (index) => x(turned_deg[rows[index]?.capture ?? ""] ?? 0) };
}

/** @param {Scale & { most?: number }} scale */
function turnLabels({ most = 10 }) {
  const step = [5, 10, 20, 30, 60].find((one) => most / one <= 7) ?? 60;
  const angles = Array.from({ length: Math.floor(most / step) + 1 }, (_, index) => index * step);
  return angles.map((angle) => s("text", { class: "tick", x: LEFT + 12 + (angle / most) * (WIDTH - LEFT - 24), y: HEIGHT - 8, "text-anchor": "middle" }, `${angle}°`));
}

/** @param {boolean} rejected */
function legend(rejected) {
  return h(
    "p", { class: "legend small" },
    h("span", { class: "key key-used" }, t("residuals.used")),
    rejected && h("span", { class: "key key-out" }, t("residuals.out")),
    h("span", { class: "key key-band" }, t("residuals.band")),
  );
}

/** @param {Scale} scale */
function axis({ top, width, y }) {
  const step = top > 8 ? Math.ceil(top / 4) : 2;
  const values = Array.from({ length: Math.floor(top / step) + 1 }, (_, index) => index * step);
  return values.flatMap((value) => [
    s("path", { class: "grid", d: `M${LEFT} ${y(value).toFixed(1)}H${width}` }),
    s("text", { class: "tick", x: LEFT - 8, y: y(value) + 4, "text-anchor": "end" }, value ? `${value} σ` : "0"),
  ]);
}

/**
 * @param {Residual} row
 * @param {number} index
 * @param {number} count
 * @param {Scale} scale
 */
function labelOf(row, index, count, { x }) {
  if (index % Math.ceil(count / 14)) return [];
  return [s("text", { class: "tick", x: x(index), y: HEIGHT - 8, "text-anchor": "middle" }, row.capture)];
}

/**
 * @param {Residual} row
 * @param {number} x
 * @param {Scale} scale
 * @param {SessionState} state
 */
function dot(row, x, { y, top }, state) {
  const value = row.mahalanobis;
  if (typeof value !== "number") return [];
  const place = y(value);
  const words = t(row.used ? "residuals.dot" : "residuals.dot_out", {
    capture: row.capture, ratio: fixed(value, 1), distance: small(row.center_distance_mm), reason: row.reason ?? "",
  });
  const pick = () => state.select(row.capture);
  const key = (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    pick();
  };
  const shape = row.used
    ? s("circle", { class: "dot", cx: x, cy: place, r: 5 })
    : s("path", { class: "cross", d: `M${x - 5} ${place - 5}l10 10m0 -10l-10 10` });
  const picked = state.selected === row.capture;
  return [s(
    "g", { class: picked ? "mark-point picked" : "mark-point", role: "button", tabindex: 0, "aria-pressed": String(picked), "aria-label": words, "data-capture": row.capture, onclick: pick, onkeydown: key },
    s("title", {}, words), s("rect", { class: "hit", x: x - 7, y: place - 12, width: 14, height: 24 }), shape,
    value > top && s("path", { class: "beyond", d: `M${x - 4} ${place - 8}l4 -4l4 4` }),
  )];
}
