// Two captures side by side: what was seen in each, and how the flange moved between them.

import "../texts/later.js";
import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { h } from "../dom.js";
import { fixed, integer, millimetres, small } from "../format.js";
import { mark } from "../icons.js";
import { maybe, t } from "../texts.js";
import { framePlot } from "../measure/frame-plot.js";
import { profilePlot } from "../measure/profile-plot.js";

/** @import {CaptureOut, Measured} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const DEGREE = Math.PI / 180;

/** The figures, each as words of one capture. @type {readonly (readonly [import("../texts.js").Text, (measured: Measured) => string])[]} */
const FIGURES = [
  ["column.zone", ({ zone }) => (typeof zone === "number" ? fixed(zone, 2) : "–")],
  ["quality.rms", ({ rms_mm }) => small(rms_mm)],
  ["quality.noise", ({ point_sigma_mm }) => small(point_sigma_mm)],
  ["both.points", ({ on_sphere, points }) => integer(on_sphere || points || 0)],
  ["quality.extent", ({ extent_deg }) => (typeof extent_deg === "number" ? `${fixed(extent_deg, 0)}°` : "–")],
];

/**
 * @param {SessionState} state
 * @param {CaptureOut} a
 * @param {CaptureOut} b
 */
export function compareCaptures(state, a, b) {
  const moved = h("p", { class: "small", "aria-live": "polite" });
  void describeMotion(state.id, a, b, moved);
  const both = [a, b];
  return h(
    "section", { class: "both", "aria-label": t("both.title", { a: a.id, b: b.id }) },
    h("div", { class: "both-plots" }, ...both.map((one) => (one.measured.preview ?? []).length > 0 && h("figure", {}, plot(one, state.id), h("figcaption", { class: "small" }, one.id)))),
    h("table", { class: "number" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, t("both.figure")), ...both.map(({ id }) => h("th", { scope: "col", class: "right" }, id)))),
      h("tbody", {},
        row(t("column.state"), both.map(({ measured: { verdict } }) => mark(verdict, maybe(`quality.${verdict}`, verdict)))),
        ...FIGURES.map(([name, words]) => row(t(name), both.map(({ measured }) => words(measured)))))),
    moved,
  );
}

/** @param {CaptureOut} capture @param {string} sessionId */
function plot(capture, sessionId) {
  return capture.measured.image_size ? framePlot(capture, sessionId) : profilePlot(capture.measured, { width: 232, height: 152 });
}

/** @param {string} name @param {(Node | string)[]} cells */
function row(name, cells) {
  return h("tr", {}, h("th", { scope: "row" }, name), ...cells.map((cell) => h("td", { class: "right" }, cell)));
}

/**
 * The server reads both poses, as it does for solving; what it cannot read it says at the capture.
 * @param {string} sessionId
 * @param {CaptureOut} a
 * @param {CaptureOut} b
 * @param {HTMLElement} into
 */
async function describeMotion(sessionId, a, b, into) {
  const words = [];
  if (a.pose && b.pose) {
    const read = await api.readPoseLines(sessionId, [a.pose, b.pose].map((pose) => pose.join(" ")).join("\n")).catch(unless);
    const [from, to] = read.items.map(({ matrix }) => matrix);
    if (from && to) words.push(t("both.moved", { a: a.id, b: b.id, distance: millimetres(distance(from, to)), angle: fixed(turn_deg(from, to), 2) }));
  }
  if (typeof a.table_deg === "number" && typeof b.table_deg === "number") words.push(t("both.table", { angle: fixed(b.table_deg - a.table_deg, 3) }));
  into.textContent = words.join(" ");
}

/** @param {unknown} error @returns {import("../state/model.js").PoseLines} */
function unless(error) {
  if (error instanceof Problem) return { items: [] };
  throw error;
}

/** Between the origins of two poses, in mm. @param {number[][]} from @param {number[][]} to */
const distance = (from, to) => Math.hypot(...[0, 1, 2].map((axis) => (to[axis]?.[3] ?? 0) - (from[axis]?.[3] ?? 0)));

/** From the antisymmetric part too, so that small turns keep their digits. @param {number[][]} from @param {number[][]} to */
function turn_deg(from, to) {
  const part = (/** @type {number} */ i, /** @type {number} */ j) => [0, 1, 2].reduce((sum, k) => sum + (from[k]?.[i] ?? 0) * (to[k]?.[j] ?? 0), 0);
  const sine = Math.hypot(part(2, 1) - part(1, 2), part(0, 2) - part(2, 0), part(1, 0) - part(0, 1)) / 2;
  return Math.atan2(sine, (part(0, 0) + part(1, 1) + part(2, 2) - 1) / 2) / DEGREE;
}
