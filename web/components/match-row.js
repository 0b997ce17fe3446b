// A file and its pose side by side, before they become a capture.

import { h } from "../dom.js";
import { fixed } from "../format.js";
import { mark } from "../icons.js";
import { said, t } from "../texts.js";

/** @import {Found} from "../state/files.js" */
/** @import {ParsedPose} from "../state/model.js" */

/**
 * @param {Found | undefined} found
 * @param {ParsedPose | undefined} pose
 * @param {HTMLElement | null} stored
 */
export function matchRow(found, pose, stored) {
  const matrix = pose?.matrix;
  return h(
    "tr", {},
    h("td", {}, found ? found.path : mark("warn", t("match.no_file")), " ", stored),
    h("td", { class: "mono" }, pose ? pose.text : mark("warn", t("match.no_line"))),
    h("td", { class: "number" }, matrix ? `${[0, 1, 2].map((row) => fixed(matrix[row]?.[3] ?? 0, 1)).join("  ")} mm` : pose && mark("fail", said(pose.problem ?? ""))),
    h("td", {}, matrix && direction(matrix.slice(0, 3).map((row) => row[2] ?? 0))),
  );
}

/** A pose that could be read has only numbers. @param {ParsedPose} pose */
export function numbersOf(pose) {
  return (pose.numbers ?? []).filter((number) => number !== null);
}

/** Where the flange's z axis looks, in words: the quickest check of a convention. @param {number[]} axis */
function direction(axis) {
  const names = [["match.minus_x", "match.plus_x"], ["match.minus_y", "match.plus_y"], ["match.down", "match.up"]];
  const largest = axis.reduce((best, value, index) => (Math.abs(value) > Math.abs(axis[best] ?? 0) ? index : best), 0);
  const value = axis[largest] ?? 0;
  const key = /** @type {"match.up"} */ (names[largest]?.[value > 0 ? 1 : 0]);
  return t("match.z_looks", { where: t(key), angle: fixed((Math.acos(Math.min(Math.abs(value), 1)) * 180) / Math.PI, 0) });
}
