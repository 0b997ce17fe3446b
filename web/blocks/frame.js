// A transform as the controller wants it typed in, each number with its uncertainty; the matrix on demand.

import { copyButton } from "../components/copy.js";
import { glossed } from "../components/glossary.js";
import { h } from "../dom.js";
import { forController } from "../format.js";
import { maybe, t } from "../texts.js";
import { quantityWords } from "./quantity.js";

/** @import {FrameBlock} from "../state/model.js" */

/** What failed is not ready to copy. @param {FrameBlock} block @param {boolean} [failed] */
export function frame({ name, matrix, numbers = [], units = "", convention = "" }, failed = false) {
  const written = units.replace(convention, maybe(`convention.${convention}`, convention)).replace("degrees", t("frame.degrees")).replace("radians", t("frame.radians"));
  const rows = matrix.map((row) => row.map((value) => value.toPrecision(12)).join(" ")).join("\n");
  const typed = numbers.map(({ quantity: { value, decimals = 0 } }) => (value ?? 0).toFixed(Math.max(decimals, 3))).join(" ");
  return h("div", { class: "frame-block" },
    numbers.length > 0 && h("div", { class: "row spread" }, h("p", { class: "soft small" }, glossed(t("frame.what", { units: written }))), !failed && copyButton(typed, t("frame.copy"))),
    numbers.length > 0 && h("dl", { class: "frame-numbers number" }, ...numbers.map((number) => h("div", {}, h("dt", {}, number.label), h("dd", {}, quantityWords(number.quantity, forController))))),
    h("details", { class: "raw" }, h("summary", {}, t("frame.matrix", { name })), h("pre", { class: "mono", tabindex: 0, "aria-label": name }, rows), !failed && copyButton(rows, t("frame.copy_matrix"))));
}
