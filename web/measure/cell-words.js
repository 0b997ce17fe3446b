// A cell in a line: robot, what the scanner delivers, sphere.

import { maybe, t } from "../texts.js";

/** @import {SessionSummary} from "../state/model.js" */

/** @param {SessionSummary["cell"]} cell */
export function cellWords(cell) {
  const parts = [maybe(`convention.${cell.pose_convention}`, cell.pose_convention)];
  if (cell.scanner?.kind) parts.push(maybe(`kind.${cell.scanner.kind}`, cell.scanner.kind));
  if (cell.sphere_diameter_mm) parts.push(t("cell.sphere", { diameter: cell.sphere_diameter_mm }));
  return parts.join(" · ");
}
