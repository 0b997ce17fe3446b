// Residuals against the table's angle: what turns with the table shows as a wave. One mark a capture and a figure.

import { h, s } from "../dom.js";
import { fixed, significant } from "../format.js";
import { t } from "../texts.js";

/** @import {TurntableResidual} from "../model.js" */
/** @import {SessionState} from "../state.js" */

/** @typedef {"radial_mm" | "tangential_mm" | "axial_mm" | "angle_deg"} Figure */
/** @typedef {{ figures: Figure[], unit: string, label: string }} Shown */

const WIDTH = 560;
const HEIGHT = 172;
const LEFT = 64;
const BOTTOM = 26;
const TOP = 10;
const BESIDE_PX = 5;

/**
 * @param {TurntableResidual[]} rows
 * @param {Shown} shown
 * @param {SessionState} state
 */
export function anglePlot(rows, { figures, unit, label }, state) {
  const drawn = rows.filter((row) => typeof row.table_deg === "number" && figures.some((figure) => typeof row[figure] === "number"));
  if (!drawn.length) return h("p", { class: "soft" }, t("residuals.none"));
  const mounts = [...new Set(drawn.map((row) => row.mount ?? ""))];
  const scale = scaleOf(drawn, figures);
  return h(
    "div", { class: "plot-holder" },
    s("svg", { class: "residual-plot angle-plot", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, style: `max-width: ${WIDTH}px`, role: "group", "aria-label": label },
      ...axes(scale, unit),
      ...drawn.flatMap((row) => figures.flatMap((figure, which) => markOf(row, figure, which, mounts.indexOf(row.mount ?? ""), mounts.length, scale, unit, state)))),
    legend(figures, mounts, drawn.some((row) => !row.used)),
  );
}

/**
 * @param {TurntableResidual[]} rows
 * @param {Figure[]} figures
 */
function scaleOf(rows, figures) {
  const values = rows.flatMap((row) => (row.used ? figures.map((figure) => Math.abs(row[figure] ?? 0)) : []));
  const top = roundUp(Math.max(...values, 1e-6) * 1.05);
  const angles = rows.map((row) => row.table_deg ?? 0);
  const low = Math.min(0, ...angles);
  const high = Math.max(360, ...angles);
  return {
    top, low, high,
    x: (/** @type {number} */ angle) => LEFT + 14 + ((angle - low) / (high - low)) * (WIDTH - LEFT - 28),
    y: (/** @type {number} */ value) => TOP + ((HEIGHT - TOP - BOTTOM) * (1 - Math.max(-1, Math.min(1, value / top)))) / 2,
  };
}

/** The next of 1, 2, 5 times a power of ten. @param {number} value */
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return ([1, 2, 5].find((step) => step * power >= value) ?? 10) * power;
}

/** @typedef {ReturnType<typeof scaleOf>} Scale */

/** @param {Scale} scale @param {string} unit */
function axes({ top, low, high, x, y }, unit) {
  const angles = Array.from({ length: Math.floor((high - low) / 90) + 1 }, (_, index) => Math.ceil(low / 90) * 90 + index * 90).filter((angle) => angle <= high);
  return [
    ...[top, 0, -top].flatMap((value) => [
      s("path", { class: value ? "grid" : "grid zero", d: `M${LEFT} ${y(value).toFixed(1)}H${WIDTH}` }),
      s("text", { class: "tick", x: LEFT - 8, y: y(value) + 4, "text-anchor": "end" }, value ? `${value > 0 ? "+" : ""}${fixed(value, decimals(top))} ${unit}` : "0"),
    ]),
    ...angles.map((angle) => s("text", { class: "tick", x: x(angle), y: HEIGHT - 8, "text-anchor": "middle" }, `${angle}°`)),
  ];
}

/** @param {number} top */
const decimals = (top) => Math.max(0, -Math.floor(Math.log10(top)));

/**
 * @param {TurntableResidual} row
 * @param {Figure} figure
 * @param {number} which figure of the plot, told by its shape
 * @param {number} mount told by filled or hollow
 * @param {number} mounts
 * @param {Scale} scale
 * @param {string} unit
 * @param {SessionState} state
 */
function markOf(row, figure, which, mount, mounts, { x: xOf, y: yOf }, unit, state) {
  const value = row[figure];
  if (typeof value !== "number") return [];
  const x = xOf(row.table_deg ?? 0) + (mount - (mounts - 1) / 2) * 2 * BESIDE_PX + (which ? 2 : 0);
  const y = yOf(value);
  const words = t(row.used ? "table.dot" : "table.dot_out", {
    capture: row.capture, angle: fixed(row.table_deg ?? 0, 1), mount: row.mount ?? "",
    figure: t(`table.${figure}`), value: `${value > 0 ? "+" : ""}${significant(value, 2)} ${unit}`, reason: row.reason ?? "",
  });
  const pick = () => state.select(row.capture);
  const key = (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    pick();
  };
  const picked = state.selected === row.capture;
  return [s(
    "g", { class: `mark-point mount-${mount % 2}${picked ? " picked" : ""}`, role: "button", tabindex: 0, "aria-pressed": String(picked), "aria-label": words, "data-capture": row.capture, onclick: pick, onkeydown: key },
    s("title", {}, words), s("rect", { class: "hit", x: x - 6, y: y - 8, width: 12, height: 16 }), shape(row.used, which, x, y),
  )];
}

/** @param {boolean} used @param {number} which @param {number} x @param {number} y */
function shape(used, which, x, y) {
  if (!used) return s("path", { class: "cross", d: `M${x - 5} ${y - 5}l10 10m0 -10l-10 10` });
  if (which) return s("path", { class: "dot other", d: `M${x} ${y - 5.5}l5.5 5.5l-5.5 5.5l-5.5 -5.5Z` });
  return s("circle", { class: "dot", cx: x, cy: y, r: 4.5 });
}

/** @param {Figure[]} figures @param {string[]} mounts @param {boolean} rejected */
function legend(figures, mounts, rejected) {
  const sign = (/** @type {number} */ which, /** @type {number} */ mount) =>
    s("svg", { class: "angle-plot key-sign", viewBox: "0 0 14 14", width: 14, height: 14, "aria-hidden": "true" }, s("g", { class: `mount-${mount % 2}` }, shape(true, which, 7, 7)));
  return h(
    "p", { class: "legend small" },
    ...(figures.length > 1 ? figures.map((figure, which) => h("span", {}, sign(which, 0), " ", t(`table.${figure}`))) : []),
    ...(mounts.length > 1 ? mounts.map((mount, index) => h("span", {}, sign(0, index), " ", t("table.mount", { mount }))) : []),
    rejected && h("span", { class: "key key-out" }, t("residuals.out")),
  );
}
