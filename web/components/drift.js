// How a cell's answer moved from session to session: a small line of how far each lies from the newest, at the scanner's origin.

import { api } from "../state/api.js";
import { h, s } from "../dom.js";
import { small } from "../format.js";
import { t } from "../texts.js";

/** @import {SessionSummary} from "../state/model.js" */

const MOST = 8;
const [WIDTH, HEIGHT, EDGE] = [96, 24, 3];

/** @param {readonly SessionSummary[]} sessions of one cell, the newest first */
export function drift(sessions) {
  const holder = h("span", { class: "drift" });
  const solved = sessions.filter(({ verdicts }) => verdicts["tcp"] || verdicts["chain"]).slice(0, MOST).reverse();
  if (solved.length < 2) return holder;
  // The list does not wait for it, and does without it where an answer cannot be had.
  void Promise.all(solved.map(({ id }) => api.answer(id).catch(() => null))).then((answers) => {
    const places = answers.flatMap((answer) => placeOf(answer) ?? []);
    const last = places.at(-1);
    if (!last || places.length < 2) return;
    const off = places.map((place) => Math.hypot(...place.map((value, axis) => value - (last[axis] ?? 0))));
    const words = t("start.drift", { count: off.length, most: small(Math.max(...off)) });
    holder.replaceChildren(line(off, words), h("span", { class: "soft small number" }, small(Math.max(...off))));
  });
  return holder;
}

/** @param {Awaited<ReturnType<typeof api.answer>> | null} answer @returns {[number[]] | null} */
function placeOf(answer) {
  const matrix = answer?.tool0_from_laser?.matrix;
  return matrix ? [[0, 1, 2].map((row) => Number(matrix[row]?.[3]))] : null;
}

/** @param {number[]} values @param {string} words */
function line(values, words) {
  const most = Math.max(...values, 1e-6);
  const at = values.map((value, index) => [EDGE + (index / (values.length - 1)) * (WIDTH - 2 * EDGE), HEIGHT - EDGE - (value / most) * (HEIGHT - 2 * EDGE)]);
  return s("svg", { class: "sparkline", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, role: "img", "aria-label": words },
    s("title", {}, words), s("path", { d: at.map(([x, y], index) => `${index ? "L" : "M"}${x} ${y}`).join("") }),
    s("circle", { cx: at.at(-1)?.[0], cy: at.at(-1)?.[1], r: 2.5 }));
}
