// Asking why, where a deed is kept with its reason: what it does in words, a field, and what the server refuses said in it.

import { field, h } from "../dom.js";
import { t } from "../texts.js";
import { alarm, closeButton, openDialog } from "../components/dialog.js";

/**
 * What was typed stays where the server refuses it; `after` follows once the dialog is gone and the focus can be set.
 * @template T
 * @param {{ title: string, words: (Node | string)[], go: string, act: (why: string) => Promise<T>, after: (done: T) => unknown, otherwise?: (() => void) | undefined }} deed `otherwise` where it is not gone on with
 */
export function whyDialog({ title, words, go, act, after, otherwise }) {
  const { element: problem, during } = alarm();
  const why = h("input", { required: true, maxlength: 1000, autocomplete: "off", autofocus: true });
  const submit = h("button", { type: "submit", class: "primary" }, go);
  const givenUp = () => otherwise?.();
  const send = async () => {
    if (!why.reportValidity()) return;
    submit.disabled = true;
    submit.disabled = await during(async () => {
      const done = await act(why.value.trim());
      dialog.removeEventListener("close", givenUp);
      dialog.close();
      await after(done);
    });
  };
  const dialog = openDialog("why", title, [
    ...words.map((one) => h("p", {}, one)), problem, field("why", t("release.why"), why, t("release.why_hint")),
    h("div", { class: "row end" }, closeButton(), submit),
  ], { submit: send });
  dialog.addEventListener("close", givenUp);
}
