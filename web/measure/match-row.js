// Files and their poses side by side, before they become captures.

import "../texts/later.js";
import { h } from "../dom.js";
import { fixed } from "../format.js";
import { mark } from "../icons.js";
import { said, t } from "../texts.js";
import { profilePlot } from "./profile-plot.js";

/** @import {Found} from "../state/files.js" */
/** @import {Measured, ParsedPose} from "../state/model.js" */

/** @typedef {{ found?: Found | undefined, pose?: ParsedPose | undefined, isStored: boolean, picture?: Element | null | undefined }} Pair */

/** @param {Pair[]} pairs @param {boolean} boards frames of them need no pose */
export function matchTable(pairs, boards) {
  const heads = boards ? /** @type {const} */ (["file"]) : /** @type {const} */ (["file", "line", "flange", "look"]);
  return h("table", {},
    h("thead", {}, h("tr", {}, ...heads.map((head) => h("th", { scope: "col" }, t(`match.${head}`))))),
    h("tbody", {}, ...pairs.map((pair) => matchRow(pair, boards))));
}

/** @param {Pair} pair @param {boolean} board */
function matchRow({ found, pose, isStored, picture }, board) {
  const matrix = pose?.matrix, stored = isStored ? mark("pass", t("match.stored")) : null;
  if (board) return h("tr", {}, h("td", {}, found?.path ?? "", " ", stored));
  return h(
    "tr", {},
    h("td", {}, picture, found ? found.path : mark("warn", t("match.no_file")), " ", stored),
    h("td", { class: "mono" }, pose ? pose.text : mark("warn", t("match.no_line"))),
    h("td", { class: "number" }, matrix ? `${[0, 1, 2].map((row) => fixed(matrix[row]?.[3] ?? 0, 1)).join("  ")} mm` : pose && mark("fail", said(pose.problem ?? ""))),
    h("td", {}, matrix && direction(matrix.slice(0, 3).map((row) => row[2] ?? 0))),
  );
}

/** Some points of a measurement as a small picture. @param {string} path @param {number[][]} preview */
export function pictureOf(path, preview) {
  const seen = /** @type {Measured} */ (/** @type {unknown} */ ({ capture: path, kind: "profile", points: preview.length, preview }));
  const plot = profilePlot(seen, { width: 48, height: 28, scale: false, most: 60 });
  plot.setAttribute("aria-hidden", "true");
  plot.removeAttribute("role");
  plot.removeAttribute("aria-label");
  return plot;
}

/** @param {File} file */
export function imageOf(file) {
  const image = h("img", { class: "thumb", alt: "", width: 48, height: 28 });
  const address = URL.createObjectURL(file);
  image.onload = image.onerror = () => URL.revokeObjectURL(address);
  image.src = address;
  return image;
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
