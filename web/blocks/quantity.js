// A number as the server says that it is shown: with its decimals, its uncertainty and its unit.

import { fixed } from "../format.js";

/** @import {Quantity} from "../state/model.js" */

/** @param {string} unit */
const behind = (unit) => (unit === "" || unit === "°" ? unit : `\u202f${unit}`);

/** `140.32 ± 0.08 mm`; an uncertainty alone as `±0.08 mm`. @param {Quantity | null | undefined} quantity @param {typeof fixed} [written] how its numbers are written */
export function quantityWords(quantity, written = fixed) {
  if (!quantity) return "–";
  const { value, uncertainty, unit = "", decimals = 0 } = quantity;
  const spread = typeof uncertainty === "number" ? written(uncertainty, decimals) : null;
  if (typeof value !== "number") return spread === null ? "–" : `±${spread}${behind(unit)}`;
  return spread === null ? `${written(value, decimals)}${behind(unit)}` : `${written(value, decimals)}\u00a0±\u00a0${spread}${behind(unit)}`;
}
