// The keys that the session page knows.

import { h } from "../dom.js";
import { learnTexts, t } from "../texts.js";

await learnTexts("plots");

/** @import {Text} from "../texts.js" */

/** @type {readonly (readonly [string, Text])[]} */
const KEYS = [
  [t("key.space"), "keys.capture"], ["S · Enter", "keys.solve"], ["Ctrl+Z", "keys.undo"], ["Ctrl+Shift+Z", "keys.redo"],
  ["1 – 9", "keys.step"], ["M · R", "keys.view"], ["← →", "keys.dots"], ["Enter", "keys.pick"], ["X", "keys.exclude"], ["?", "keys.keys"],
];

export function keysDialog() {
  const dialog = h("dialog", { "aria-labelledby": "keys-title" }, h("div", { class: "body" },
    h("h2", { id: "keys-title" }, t("keys.title")),
    h("dl", { class: "keys" }, ...KEYS.map(([key, words]) => h("div", {}, h("dt", {}, h("kbd", {}, key)), h("dd", {}, t(words))))),
    h("div", { class: "row end" }, h("button", { type: "button", autofocus: true, onclick: () => dialog.close() }, t("close")))));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
