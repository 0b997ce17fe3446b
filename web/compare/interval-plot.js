// Differences with their intervals, one row an axis, in units of the expanded uncertainty: an interval without the zero line
// in it tells that the axis differs.

import { h, s } from "../dom.js";
import { fixed } from "../format.js";
import { maybe, t } from "../texts.js";

/** @import {FrameDifference} from "../state/model.js" */

const [WIDTH, ROW, NAME, EDGE] = [460, 24, 130, 12];
const K = 2;

/** @param {FrameDifference} frame */
export function intervalPlot({ axes }) {
  const known = axes.filter(({ sigma }) => sigma > 0);
  if (!known.length) return null;
  const rows = known.map(({ axis, difference, sigma }) => ({ name: maybe(`comparison.axis_${axis}`, axis), at: difference / (K * sigma) }));
  const most = Math.max(1.5, ...rows.map(({ at }) => Math.abs(at) + 1)) * 1.05;
  const x = (/** @type {number} */ value) => NAME + EDGE + ((value + most) / (2 * most)) * (WIDTH - NAME - 2 * EDGE);
  const height = ROW * rows.length + 22;
  const words = rows.map(({ name, at }) => `${name} ${fixed(at, 1)}`).join(", ");
  return h("figure", { class: "interval-plot" },
    s("svg", { viewBox: `0 0 ${WIDTH} ${height}`, role: "img", "aria-label": `${t("comparison.intervals")} ${words}` },
      s("rect", { class: "band", x: x(-1), y: 0, width: x(1) - x(-1), height: height - 22 }), s("path", { class: "zero", d: `M${x(0)} 0V${height - 22}` }),
      ...rows.flatMap(({ name, at }, index) => {
        const y = ROW * (index + 0.5);
        const far = Math.abs(at) > 1;
        return [s("text", { class: "tick", x: NAME, y: y + 4, "text-anchor": "end" }, name),
          s("path", { class: far ? "interval far" : "interval", d: `M${x(at - 1)} ${y}H${x(at + 1)}M${x(at - 1)} ${y - 4}v8M${x(at + 1)} ${y - 4}v8` }),
          s("circle", { class: far ? "interval far" : "interval", cx: x(at), cy: y, r: 3.5 })];
      }),
      ...[-1, 0, 1].map((value) => s("text", { class: "tick", x: x(value), y: height - 6, "text-anchor": "middle" }, value ? `${value > 0 ? "+" : "−"}U` : "0"))),
    h("figcaption", { class: "soft small" }, t("comparison.intervals")));
}
