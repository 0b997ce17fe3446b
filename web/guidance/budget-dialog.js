// The error budget at a point of the workpiece that the user picks: by its numbers, or in the field over the table.

import "../texts/later.js";
import { get } from "../state/http.js";
import { h, s } from "../dom.js";
import { fixed, plusMinus, small } from "../format.js";
import { t } from "../texts.js";
import { alarm } from "../components/dialog.js";
import { choice, numberField, opened, tableOf } from "./parts.js";

/** @import {BudgetAtPart, FieldPoint} from "../api-types.js" */

const SIZE = 260;
const SHADES = 6;

/** @param {string} sessionId */
export function budgetDialog(sessionId) {
  const { element: problem, during } = alarm();
  const axes = /** @type {const} */ (["x", "y", "z"]).map((axis) => numberField(`budget-${axis}`, t("budget.axis", { axis }), null));
  const figures = h("div", { class: "budget-figures", "aria-live": "polite" });
  const holder = h("div", { class: "budget-field" });
  /** @type {FieldPoint[]} */ let field = [];

  /** @param {(number | null)[]} point @param {boolean} [withField] */
  const ask = (point, withField = false) => during(async () => {
    const asked = new URLSearchParams(point.some((one) => one === null) ? {} : { x_mm: String(point[0]), y_mm: String(point[1]), z_mm: String(point[2]) });
    if (withField) asked.set("field", "true");
    /** @type {BudgetAtPart} */
    const found = await get(`/sessions/${encodeURIComponent(sessionId)}/budget?${asked}`);
    axes.forEach(({ input }, index) => { input.value = fixed(found.point_mm[index] ?? 0, 1).replace("\u2212", "-"); });
    figures.replaceChildren(...figuresOf(found));
    if (found.field?.length) field = found.field;
    holder.replaceChildren(...(field.length ? drawn(field, found.point_mm, (picked) => void ask(picked)) : []));
  });
  const submit = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const point = axes.map(({ read }) => read());
    if (point.some((one) => one === undefined)) return;
    await ask(/** @type {(number | null)[]} */ (point));
  };
  opened("budget", t("budget.title"), h("p", { class: "soft" }, t("budget.how")),
    h("form", { class: "fields", novalidate: true, onsubmit: submit }, ...axes.map(({ element }) => element), h("button", { type: "submit" }, t("budget.go"))),
    problem, figures, holder);
  void ask([null, null, null], true);
}

/** @param {BudgetAtPart} found @returns {HTMLElement[]} */
function figuresOf(found) {
  const rows = found.parts.map((part) => [t(`budget.part_${part.name}`), small(part.sigma_mm), small(part.worst_sigma_mm), t(part.shared ? "budget.shared" : "budget.averages")]);
  return [
    h("p", {}, h("strong", {}, t("budget.one_scan", { one: plusMinus(found.uncertainty_mm, "mm"), many: plusMinus(found.shared_uncertainty_mm, "mm") }))),
    tableOf([t("budget.part"), t("budget.rms"), t("budget.worst"), t("budget.kind")], rows, t("budget.title")),
    h("p", { class: "soft" }, t(found.cancelled_mm < 0 ? "budget.add_up" : "budget.cancel", { amount: small(Math.abs(found.cancelled_mm)) })),
    h("p", { class: "soft" }, t("budget.within", { within: each(found.within_95_mm) }), ...(found.known_offset_mm.some(worthSaying) ? [" ", t("budget.offset", { offset: each(found.known_offset_mm) })] : [])),
    h("p", {}, found.helps_most),
    ...(found.stale ? [h("p", { class: "form-problem" }, t("budget.stale"))] : []),
  ];
}

/** Three lengths as text. @param {number[]} lengths_mm */
function each(lengths_mm) {
  return lengths_mm.map(small).join(", ");
}

/** Whether a length is more than half a micrometre. @param {number} length_mm */
function worthSaying(length_mm) {
  return Math.abs(length_mm) >= 0.0005;
}

/** The field at one height, seen from above; a click picks a point. @param {FieldPoint[]} field @param {number[]} point @param {(point: number[]) => void} pick @returns {Element[]} */
function drawn(field, point, pick) {
  const heights = [...new Set(field.map(({ point_mm: [, , z] }) => z ?? 0))].sort((one, other) => one - other);
  const nearest = heights.reduce((best, one) => (Math.abs(one - (point[2] ?? 0)) < Math.abs(best - (point[2] ?? 0)) ? one : best), heights[0] ?? 0);
  const layer = choice("budget-height", t("budget.height"), heights.map((z) => [String(z), `${fixed(z, 0)} mm`]));
  layer.select.value = String(nearest);
  layer.select.addEventListener("change", () => pick([point[0] ?? 0, point[1] ?? 0, Number(layer.select.value)]));
  const shown = field.filter(({ point_mm: [, , z] }) => z === nearest);
  const reach = Math.max(...field.map(({ point_mm: [x, y] }) => Math.hypot(x ?? 0, y ?? 0)), 1) * 1.15;
  const values = field.map(({ uncertainty_mm: one }) => one);
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const shade = (/** @type {number} */ value) => Math.min(SHADES - 1, Math.floor((SHADES * (value - least)) / Math.max(most - least, 1e-9)));
  const scale = SIZE / (2 * reach);
  const place = (/** @type {readonly number[]} */ [x = 0, y = 0]) => ({ cx: SIZE / 2 + x * scale, cy: SIZE / 2 - y * scale });
  const picture = s("svg", { viewBox: `0 0 ${SIZE} ${SIZE}`, width: SIZE, height: SIZE, role: "img", "aria-label": t("budget.picture", { least: plusMinus(least, "mm"), most: plusMinus(most, "mm") }) },
    s("circle", { class: "rim", cx: SIZE / 2, cy: SIZE / 2, r: SIZE / 2 - 2 }),
    ...shown.map((one) => s("circle", { class: `shade-${shade(one.uncertainty_mm)}`, ...place(one.point_mm), r: 9 }, s("title", {}, plusMinus(one.uncertainty_mm, "mm")))),
    s("circle", { class: "picked", ...place(point), r: 12 }));
  picture.addEventListener("click", (event) => {
    const box = picture.getBoundingClientRect();
    const along = (/** @type {number} */ at) => Math.round(((at - 0.5) * SIZE) / scale);
    pick([along((event.clientX - box.left) / box.width), -along((event.clientY - box.top) / box.height), nearest]);
  });
  return [picture, h("div", {}, layer.element, h("p", { class: "soft" }, t("budget.pick", { least: plusMinus(least, "mm"), most: plusMinus(most, "mm") })))];
}
