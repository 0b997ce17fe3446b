// What a finding means, how it is decided and what to do: the page of its code, one click from the message.

import { coded, h } from "../dom.js";
import { api } from "../state/api.js";
import { t } from "../texts.js";
import { closeButton, openDialog } from "../components/dialog.js";
import { attempt } from "../components/toasts.js";

/** A button that explains a code. @param {string} code */
export const explains = (code) => h("button", { type: "button", class: "plain small", onclick: () => void explain(code) }, t("finding.explain"));

/** @param {string} code */
const explain = (code) => attempt(async () => {
  const { text, to_do, meaning, decided, usual_causes, since } = await api.codeOfFinding(code);
  const parts = /** @type {const} */ ([["finding.means", [meaning]], ["finding.decided", [decided]], ["finding.causes", [usual_causes]], ["finding.to_do", to_do]]);
  openDialog("finding", code, [
    ...text.map((one) => h("blockquote", {}, ...coded(one))),
    ...parts.filter(([, words]) => words.some(Boolean)).flatMap(([name, words]) => [h("h3", {}, t(name)), ...words.map((one) => h("p", {}, ...coded(one)))]),
    h("p", { class: "small soft" }, t("finding.since", { version: since })),
    h("div", { class: "row end" }, closeButton(t("close"), { autofocus: true })),
  ]);
});
