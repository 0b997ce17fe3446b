// A table of captures as a spreadsheet takes it: numbers as they were measured, with a point, each column with its unit.

import { knowConventions, NUMBERS } from "../state/pose-table.js";
import { t } from "../texts.js";

/** @import {Column} from "./capture-columns.js" */
/** @import {CaptureOut, PoseConvention, Residual} from "../state/model.js" */

/** @type {Readonly<Record<string, string>>} */
const UNITS = { extent: "°", edge: "px", rms: "mm", rms_px: "px", off: "σ" };

const DIGITS = 6;
/** @param {unknown} value */
const plain = (value) => (typeof value === "number" ? Number(value.toPrecision(DIGITS)) : value);

/** @param {unknown} value */
const quoted = (value) => (/[",\n]/.test(String(value ?? "")) ? `"${String(value).replaceAll('"', '""')}"` : String(value ?? ""));

/**
 * @param {readonly CaptureOut[]} captures
 * @param {readonly Column[]} columns
 * @param {ReadonlyMap<string, Residual>} residuals
 * @param {PoseConvention} convention
 */
export async function capturesAsCsv(captures, columns, residuals, convention) {
  await knowConventions();
  const numbers = NUMBERS[convention] ?? [];
  const heads = columns.flatMap(({ name, title }) =>
    name === "pose" ? numbers : name === "table" ? [`${title} (°)`, t("place.mount")] : UNITS[name] ? `${title} (${UNITS[name]})` : title);
  const row = (/** @type {CaptureOut} */ capture) => columns.flatMap(({ name, value }) =>
    name === "pose" ? numbers.map((_, place) => capture.pose?.[place]) : name === "table" ? [capture.table_deg, capture.mount] : [plain(value(capture, residuals.get(capture.id)))]);
  return [heads, ...captures.map(row)].map((cells) => cells.map(quoted).join(",")).join("\n");
}
