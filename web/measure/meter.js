// How well the workpiece is known by now, how well it should be, and how each capture brought it there.

import { h, s } from "../dom.js";
import { stated } from "../format.js";
import { t } from "../texts.js";

/** @import {Meter} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const [WIDTH, HEIGHT, EDGE] = [220, 48, 5];
const MOST_DOTS = 60;

/** @param {Meter} meter @param {SessionState} state */
export function meterSection(meter, state) {
  const { uncertainty_mm: now, wanted_mm: wanted, still_needed: more, enough } = meter;
  const doubted = state.resultOf(state.step)?.verdict !== "pass" && state.resultOf(state.step) !== null;
  const text = now === null || now === undefined ? t("meter.open") : `±${stated(now)}`;
  return h("section", { class: "meter", "aria-label": t("meter.title") },
    h("p", { class: "number" }, h("strong", { class: "meter-now" }, text),
      wanted ? h("span", { class: "soft" }, ` → ${t("answer.wanted", { limit: stated(wanted) })}`) : null,
      enough && !doubted ? h("span", {}, ` · ${t("meter.enough")}`) : more ? h("span", {}, ` · ${t("meter.more", { count: more })}`) : null),
    historyLine(meter, state));
}

/** Each capture's share, on a scale in which a halving is a step. @param {Meter} meter @param {SessionState} state */
function historyLine({ history = [], wanted_mm: wanted }, state) {
  const known = history.flatMap(({ capture, uncertainty_mm: value }, index) => (value ? [{ capture, value, index }] : []));
  if (known.length < 2) return null;
  const values = [...known.map(({ value }) => value), ...(wanted ? [wanted] : [])].map(Math.log);
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const x = (/** @type {number} */ index) => EDGE + (index / Math.max(1, history.length - 1)) * (WIDTH - 2 * EDGE);
  const y = (/** @type {number} */ value) => HEIGHT - EDGE - ((Math.log(value) - low) / (high - low || 1)) * (HEIGHT - 2 * EDGE);
  const words = t("meter.history", { first: `±${stated(known[0]?.value ?? 0)}`, last: `±${stated(known.at(-1)?.value ?? 0)}`, count: known.length });
  return s("svg", { class: "meter-history", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, role: "img", "aria-label": words },
    s("title", {}, words),
    wanted ? s("path", { class: "wanted", d: `M0 ${y(wanted)}H${WIDTH}` }) : s("g"),
    s("path", { class: "way", d: known.map(({ value, index }, k) => `${k ? "L" : "M"}${x(index).toFixed(1)} ${y(value).toFixed(1)}`).join("") }),
    ...known.filter((_, place) => (known.length - 1 - place) % Math.ceil(known.length / MOST_DOTS) === 0).map(({ capture, value, index }) => {
      const dot = s("circle", { cx: x(index), cy: y(value), r: 3.5, "data-capture": capture }, s("title", {}, `${capture}: ±${stated(value)}`));
      dot.addEventListener("click", () => state.select(capture));
      return dot;
    }));
}
