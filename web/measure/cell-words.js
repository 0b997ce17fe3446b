// A cell in a line: robot, what the scanner delivers, sphere.

import { maybe, t } from "../texts.js";

/** @import {SessionSummary} from "../state/model.js" */

/** Whether a cell's scanners stand still: nothing there is a tool. @param {import("../state/session.js").SessionState} state */
export function standsStill({ session }) {
  const scanners = /** @type {{on?: string}[]} */ (Object.values(session?.cell.scanners ?? {}));
  return scanners.length ? scanners.every(({ on }) => on === "base") : session?.cell.arrangement === "sphere-on-robot";
}

/** @param {SessionSummary["cell"]} cell */
export function cellWords(cell) {
  const parts = [maybe(`convention.${cell.pose_convention}`, cell.pose_convention)];
  if (cell.scanner?.kind) parts.push(maybe(`kind.${cell.scanner.kind}`, cell.scanner.kind));
  if (cell.sphere_diameter_mm) parts.push(t("cell.sphere", { diameter: cell.sphere_diameter_mm }));
  return parts.join(" · ");
}
