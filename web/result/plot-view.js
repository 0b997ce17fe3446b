// What of a plot is shown: its dots in sigmas, in millimetres or in parts along axes; and which piece of it, once it is zoomed.

import { t } from "../texts.js";

/** @import {PlotBlock, Residual, SeriesOf} from "../state/model.js" */
/** @typedef {{ x: [number, number], y: [number, number] }} Range */

/** Parts of the distance, by the fields or the vector that hold them. @type {readonly (readonly [string, (row: Residual, part: number) => number | null | undefined])[]} */
const PARTS = [
  ["plot.parts_base", (row, part) => row.center_offset_in_base_mm?.[part]],
  ["plot.parts_table", (row, part) => [row.radial_mm, row.tangential_mm, row.axial_mm][part]],
];

/**
 * The same captures by other figures, the plot's own first. A plot without more to say has one view.
 * @param {PlotBlock} block
 * @param {readonly Residual[]} rows of the result
 * @returns {{ label: string, block: PlotBlock }[]}
 */
export function viewsOf(block, rows) {
  const [own] = block.series;
  const names = own?.captures ?? [];
  if (!own || block.shape !== "captures" || block.y.unit !== "σ" || block.series.length > 1 || !names.length) return [{ label: "", block }];
  const found = new Map(rows.map((row) => [row.capture, row]));
  const series = (/** @type {string} */ label, /** @type {(row: Residual) => number | null | undefined} */ value) => {
    const y = names.map((name) => { const row = found.get(name); return (row && value(row)) ?? null; });
    return /** @type {SeriesOf} */ ({ ...own, label, y });
  };
  const views = [{ label: t("plot.in_sigma"), block }];
  const told = (/** @type {SeriesOf[]} */ all) => all.some(({ y }) => y.some((value) => value !== null));
  const add = (/** @type {string} */ label, /** @type {string} */ caption, /** @type {SeriesOf[]} */ all, /** @type {number | null} */ low) => {
    if (told(all)) views.push({ label, block: { ...block, caption, y: { ...block.y, unit: "mm", low, high: null }, series: all, band: null } });
  };
  add(t("plot.in_mm"), t("plot.caption_mm"), [series("", (row) => row.center_distance_mm)], 0);
  for (const [key, part] of PARTS) {
    const names = t(/** @type {"plot.parts_base"} */ (key)).split(", ");
    add(names.join(", "), t("plot.caption_parts", { parts: names.join(", ") }), names.map((name, index) => series(name, (row) => part(row, index))), null);
  }
  return views;
}

/** A piece of a plot: what lies beside it is left out, what lies above or below stands at the edge. @param {PlotBlock} block @param {Range | null} range @returns {PlotBlock} */
export function piece(block, range) {
  if (!range) return block;
  const [low, high] = range.x;
  const series = block.series.map((one) => {
    const kept = one.y.flatMap((_, index) => { const x = one.x?.[index] ?? index; return x >= low && x <= high ? [index] : []; });
    const pick = (/** @type {readonly any[] | undefined} */ all) => (all?.length ? kept.map((index) => all[index]) : all);
    return { ...one, x: kept.map((index) => one.x?.[index] ?? index), y: pick(one.y), captures: pick(one.captures), reasons: pick(one.reasons) };
  });
  const captures = block.shape === "captures";
  const x = { ...block.x, low: captures ? Math.ceil(low) : low, high: captures ? Math.floor(high) : high };
  return /** @type {PlotBlock} */ ({ ...block, series, x, y: { ...block.y, low: range.y[0], high: range.y[1] } });
}

/**
 * A range so many times as wide about a place, within the whole; null where it is the whole.
 * @param {Range} now @param {Range} whole @param {{ x: number, y: number }} about @param {number} times
 * @returns {Range | null}
 */
export function widened(now, whole, about, times) {
  const along = (/** @type {"x" | "y"} */ axis) => {
    const width = (now[axis][1] - now[axis][0]) * times, most = whole[axis][1] - whole[axis][0];
    if (width >= most) return whole[axis];
    const low = Math.min(Math.max(about[axis] - width / 2, whole[axis][0]), whole[axis][1] - width);
    return /** @type {[number, number]} */ ([low, low + width]);
  };
  const next = { x: along("x"), y: along("y") };
  return next.x === whole.x && next.y === whole.y ? null : next;
}
