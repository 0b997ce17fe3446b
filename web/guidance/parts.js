// What the dialogs of the guidance share: a dialog that says what is wrong in it, and fields of numbers.

import { Problem } from "../state/http.js";
import { h, style } from "../dom.js";
import { inField, typedNumber } from "../format.js";
import { learnTexts, t } from "../texts.js";

await learnTexts("guidance");
style("guidance");

/** A dialog that is gone when it is closed. @param {string} id @param {string} title @param {...(Element | string | false | null)} children */
export function opened(id, title, ...children) {
  const dialog = h("dialog", { class: "guidance", "aria-labelledby": `${id}-title` });
  dialog.append(h("div", { class: "body" }, h("h2", { id: `${id}-title` }, title), ...children,
    h("div", { class: "row end" }, h("button", { type: "button", onclick: () => dialog.close() }, t("guidance.close")))));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
  return dialog;
}

export function alarm() {
  const element = h("p", { class: "form-problem", role: "alert", hidden: true });
  /** What the server refuses is said in the dialog. @param {() => Promise<void>} action */
  const during = async (action) => {
    element.hidden = true;
    try {
      await action();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      element.textContent = error.message;
      element.hidden = false;
    }
  };
  return { element, during };
}

/** A number with its label; null where it is empty, undefined where it is none. @param {string} id @param {string} label @param {number | null} value */
export function numberField(id, label, value) {
  const input = h("input", { id, inputmode: "decimal", autocomplete: "off", value: inField(value) });
  input.addEventListener("input", () => input.setCustomValidity(""));
  const read = () => {
    if (!input.value.trim()) return null;
    const number = typedNumber(input.value);
    if (Number.isFinite(number)) return number;
    input.setCustomValidity(t("guidance.number"));
    input.reportValidity();
    return undefined;
  };
  return { element: h("div", { class: "field" }, h("label", { for: id }, label), input), input, read };
}

/** @param {string} id @param {string} label @param {readonly (readonly [string, string])[]} choices */
export function choice(id, label, choices) {
  const select = h("select", { id }, ...choices.map(([value, words]) => h("option", { value }, words)));
  return { element: h("div", { class: "field" }, h("label", { for: id }, label), select), select };
}

/** @param {readonly string[]} heads @param {readonly (readonly (string | Element)[])[]} rows @param {string} label */
export function tableOf(heads, rows, label) {
  return h("div", { class: "table-holder", tabindex: 0, role: "region", "aria-label": label }, h("table", { class: "number" },
    h("thead", {}, h("tr", {}, ...heads.map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, ...rows.map(([first, ...rest]) => h("tr", {}, h("th", { scope: "row" }, first ?? ""), ...rest.map((cell) => h("td", {}, cell)))))));
}
