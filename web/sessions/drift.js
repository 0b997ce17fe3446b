// How a cell's scanner moved from session to session: a small line of its change at the workpiece, and where it changed.

import { api } from "../state/api.js";
import { h, s } from "../dom.js";
import { measured, small } from "../format.js";
import { said, t } from "../texts.js";

/** @import {DriftSeries, SessionSummary} from "../state/model.js" */

const MOST = 30;
const [WIDTH, HEIGHT, EDGE] = [96, 24, 3];

/** @param {readonly SessionSummary[]} sessions of one cell that have an answer, the newest first */
export function drift(sessions) {
  const holder = h("span", { class: "drift" });
  const [newest, ...earlier] = sessions;
  if (!newest || !earlier.length) return holder;
  // The list does not wait for it, and does without it where it cannot be had.
  void api.drift(newest.cell_id).catch(() => null).then((found) => {
    const tool = found?.series.find(({ figure }) => figure === "tool");
    if (!tool || tool.points.length < 2) return;
    const last = tool.points.at(-1);
    const words = t("start.drift", { count: tool.points.length, change: small(last?.change ?? 0), limit: small(last?.limit ?? 0), finds: small(last?.finds ?? 0) });
    const within = found?.within?.find(({ session }) => session === newest.id);
    const flag = found?.flags?.at(-1) ?? found?.trends?.at(-1);
    const changed = flag ? said(flag) : (within?.found && within.sentence ? said(within.sentence) : undefined);
    holder.replaceChildren(line(tool, changed ?? words), h("span", { class: changed ? "small number changed" : "soft small number" }, measured(last?.change ?? 0, last?.uncertainty, "mm")));
  });
  return holder;
}

/** Changes as a line, control limits behind it, a dot on each that is larger than its uncertainty. @param {DriftSeries} series @param {string} words */
function line(series, words) {
  const points = series.points.slice(-MOST);
  const most = Math.max(...points.map(({ change, limit }) => Math.max(change, limit ?? 0)), 1e-6);
  /** @param {number} index @param {number} value */
  const at = (index, value) => [EDGE + (index / (points.length - 1)) * (WIDTH - 2 * EDGE), HEIGHT - EDGE - (value / most) * (HEIGHT - 2 * EDGE)];
  /** @param {readonly (readonly (number | undefined)[])[]} places */
  const path = (places) => places.map(([x, y], index) => `${index ? "L" : "M"}${x} ${y}`).join("");
  const changes = points.map(({ change }, index) => at(index, change));
  const limits = points.flatMap(({ limit }, index) => (limit == null ? [] : [at(index, limit)]));
  const marks = points.flatMap(({ flagged }, index) => (flagged ? [s("circle", { class: "changed", cx: changes[index]?.[0], cy: changes[index]?.[1], r: 3 })] : []));
  const end = changes.at(-1);
  return s("svg", { class: "sparkline", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, role: "img", "aria-label": words },
    s("title", {}, words), s("path", { class: "limit", d: path(limits) }), s("path", { d: path(changes) }),
    s("circle", { cx: end?.[0], cy: end?.[1], r: 2.5 }), ...marks);
}
