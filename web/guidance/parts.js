// What the dialogs of the guidance share: how they look, fields of numbers, choices and tables.

import "../texts/later.js";
import { closeButton, openDialog } from "../components/dialog.js";
import { field, h, style } from "../dom.js";
import { fixed, inField, typedNumber } from "../format.js";
import { t } from "../texts.js";

style("guidance");

/** @param {string} id @param {string} title @param {...import("../dom.js").Child} children */
export const opened = (id, title, ...children) => openDialog(id, title, [...children, h("div", { class: "row end" }, closeButton(t("close")))], { class: "guidance" });

/** A number with its label; null where it is empty, undefined where it is none. @param {string} id @param {string} label @param {number | null} value */
export function numberField(id, label, value) {
  const input = h("input", { inputmode: "decimal", autocomplete: "off", value: inField(value) });
  input.addEventListener("input", () => input.setCustomValidity(""));
  const read = () => {
    if (!input.value.trim()) return null;
    const number = typedNumber(input.value);
    if (Number.isFinite(number)) return number;
    input.setCustomValidity(t("guidance.number"));
    input.reportValidity();
    return undefined;
  };
  return { element: field(id, label, input), input, read };
}

/** @param {string} id @param {string} label @param {readonly (readonly [string, string])[]} choices */
export function choice(id, label, choices) {
  const select = h("select", {}, ...choices.map(([value, words]) => h("option", { value }, words)));
  return { element: field(id, label, select), select };
}

/** Where axes stand, by name. @param {{ axes_deg?: Record<string, number> | null | undefined, axes_mm?: Record<string, number> | null | undefined }} of */
export const axesWords = ({ axes_deg, axes_mm }) => [
  ...Object.entries(axes_deg ?? {}).map(([name, value]) => `${name} ${fixed(value, 1)}°`),
  ...Object.entries(axes_mm ?? {}).map(([name, value]) => `${name} ${fixed(value, 1)} mm`)].join(", ");

/** @param {readonly string[]} heads @param {readonly (readonly (string | Element)[])[]} rows @param {string} label */
export function tableOf(heads, rows, label) {
  return h("div", { class: "table-holder", tabindex: 0, role: "region", "aria-label": label }, h("table", { class: "number" },
    h("thead", {}, h("tr", {}, ...heads.map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, ...rows.map(([first, ...rest]) => h("tr", {}, h("th", { scope: "row" }, first ?? ""), ...rest.map((cell) => h("td", {}, cell)))))));
}
