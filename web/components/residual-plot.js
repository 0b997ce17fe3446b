// One dot a capture: its distance to the sphere, the band where most should lie, rejected ones crossed.

import { h, s } from "../dom.js";
import { significant, small } from "../format.js";
import { t } from "../texts.js";

/** @import {TcpResidual, TcpResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */

const HEIGHT = 180;
const LEFT = 64;
const BOTTOM = 28;
const TOP = 12;

/** @param {TcpResidual} row */
const distance_mm = (row) => row.center_distance_mm ?? row.surface_rms_mm ?? null;

/**
 * @param {TcpResult} result
 * @param {SessionState} state
 */
export function residualPlot(result, state) {
  const rows = result.residuals;
  const drawn = rows.filter((row) => distance_mm(row) !== null);
  if (!drawn.length) return h("p", { class: "soft" }, t("residuals.none"));
  const width = Math.max(420, Math.min(760, 64 + rows.length * 36));
  const band = expected_mm(result);
  const used = drawn.filter((row) => row.used).map((row) => distance_mm(row) ?? 0);
  const top = nice(Math.max(...used, band, 1e-6) * 1.25);
  const x = (/** @type {number} */ index) => LEFT + ((index + 0.5) * (width - LEFT - 8)) / rows.length;
  const y = (/** @type {number} */ value) => TOP + (HEIGHT - TOP - BOTTOM) * (1 - Math.min(value / top, 1));
  const root = s("svg", { class: "residual-plot", viewBox: `0 0 ${width} ${HEIGHT}`, role: "group", "aria-label": t("residuals.label", { band: small(band) }) });
  root.append(
    s("rect", { class: "band", x: LEFT, y: y(band), width: width - LEFT, height: y(0) - y(band) }),
    ...axis(top, y, width),
    ...rows.flatMap((row, index) => labelOf(row, index, rows.length, x)),
    ...rows.flatMap((row, index) => dot(row, x(index), y, top, state)),
  );
  return h("div", { class: "plot-holder" }, root, h("p", { class: "legend small" },
    h("span", { class: "key key-used" }, t("residuals.used")), h("span", { class: "key key-out" }, t("residuals.out")),
    h("span", { class: "key key-band" }, t("residuals.band", { band: small(band) }))));
}

/**
 * 95 % of captures lie within this distance if the stated noise is true: three axes of the robot's repeatability,
 * widened to the scatter that was found where that is all there is.
 * @param {TcpResult} result
 */
function expected_mm(result) {
  return 1.61 * (result.center_scatter_rms_mm || result.surface_rms_mm || 0);
}

/** @param {number} value */
function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((step) => step * power >= value) ?? 10);
}

/**
 * @param {number} top
 * @param {(value: number) => number} y
 * @param {number} width
 */
function axis(top, y, width) {
  const unit = top < 1 ? 1000 : 1;
  return [0, 0.5, 1].flatMap((part) => [
    s("path", { class: "grid", d: `M${LEFT} ${y(top * part).toFixed(1)}H${width}` }),
    s("text", { class: "tick", x: LEFT - 8, y: y(top * part) + 4, "text-anchor": "end" }, part ? `${significant(top * part * unit, 2)} ${unit === 1 ? "mm" : "µm"}` : "0"),
  ]);
}

/**
 * @param {TcpResidual} row
 * @param {number} index
 * @param {number} count
 * @param {(index: number) => number} x
 */
function labelOf(row, index, count, x) {
  if (index % Math.ceil(count / 16)) return [];
  return [s("text", { class: "tick", x: x(index), y: HEIGHT - 8, "text-anchor": "middle" }, row.capture)];
}

/**
 * @param {TcpResidual} row
 * @param {number} x
 * @param {(value: number) => number} y
 * @param {number} top
 * @param {SessionState} state
 */
function dot(row, x, y, top, state) {
  const value = distance_mm(row);
  if (value === null) return [];
  const place = y(value);
  const off = value > top;
  const words = t(row.used ? "residuals.dot" : "residuals.dot_out", { capture: row.capture, distance: small(value), reason: row.reason ?? "" });
  const pick = () => state.select(row.capture);
  const key = (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    event.stopPropagation();
    pick();
  };
  const shape = row.used
    ? s("circle", { class: "dot", cx: x, cy: place, r: 5 })
    : s("path", { class: "cross", d: `M${x - 5} ${place - 5}l10 10m0 -10l-10 10` });
  return [s(
    "g", { class: state.selected === row.capture ? "mark-point picked" : "mark-point", role: "button", tabindex: 0, "aria-label": words, "data-capture": row.capture, onclick: pick, onkeydown: key },
    s("title", {}, words), s("rect", { class: "hit", x: x - 12, y: place - 12, width: 24, height: 24 }), shape,
    off && s("path", { class: "beyond", d: `M${x - 4} ${place - 8}l4 -4l4 4` }),
  )];
}
