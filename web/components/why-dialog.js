// Asking why, where a deed is kept with its reason: what it does in words, a field, and what the server refuses said in it.

import { Problem } from "../state/http.js";
import { h } from "../dom.js";
import { learnTexts, t } from "../texts.js";

await learnTexts("release");

/**
 * What was typed stays where the server refuses it; `after` follows once the dialog is gone and the focus can be set.
 * @template T
 * @param {{ title: string, words: (Node | string)[], go: string, act: (why: string) => Promise<T>, after: (done: T) => unknown }} deed
 */
export function whyDialog({ title, words, go, act, after }) {
  const problem = h("p", { class: "form-problem", role: "alert", hidden: true });
  const why = h("input", { id: "why", required: true, maxlength: 1000, autocomplete: "off", autofocus: true, "aria-describedby": "why-hint" });
  const submit = h("button", { type: "submit", class: "primary" }, go);
  const dialog = h("dialog", { "aria-labelledby": "why-title" });
  const send = async (/** @type {Event} */ event) => {
    event.preventDefault();
    problem.hidden = submit.disabled = true;
    try {
      const done = await act(why.value.trim());
      dialog.close();
      await after(done);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      problem.textContent = error.message;
      problem.hidden = submit.disabled = false;
    }
  };
  dialog.append(h("form", { class: "body", onsubmit: send },
    h("h2", { id: "why-title" }, title), ...words.map((one) => h("p", {}, one)), problem,
    h("div", { class: "field" }, h("label", { for: "why" }, t("release.why")), why, h("span", { class: "hint", id: "why-hint" }, t("release.why_hint"))),
    h("div", { class: "row end" }, h("button", { type: "button", onclick: () => dialog.close() }, t("cancel")), submit)));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
