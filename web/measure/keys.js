// The keys that the session page knows.

import "../texts/later.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { closeButton, openDialog } from "../components/dialog.js";

/** @import {Text} from "../texts.js" */

/** @type {readonly (readonly [string, Text])[]} */
const KEYS = [
  [t("key.space"), "keys.capture"], ["S", "actions.solve"], ["Enter", "keys.main"], ["Ctrl+Z", "undo"], ["Ctrl+Shift+Z", "keys.redo"],
  ["1 – 9", "keys.step"], ["M · R", "keys.view"], ["← →", "keys.dots"], ["Enter", "keys.pick"], ["X", "keys.exclude"], ["?", "keys.keys"],
];

export function keysDialog() {
  const keys = KEYS.map(([key, words]) => h("div", {}, h("dt", {}, h("kbd", {}, key)), h("dd", {}, t(words))));
  openDialog("keys", t("menu.keys"), [h("dl", { class: "keys" }, ...keys), h("div", { class: "row end" }, closeButton(t("close"), { autofocus: true }))]);
}
