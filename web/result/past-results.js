// The table of all results that a stage ever had, loaded when it is opened.

import "../texts/later.js";
import { h } from "../dom.js";
import { when } from "../format.js";
import { mark } from "../icons.js";
import { maybe, plural, t } from "../texts.js";

/** @import {PastResult} from "../state/model.js" */

/** @param {PastResult[]} items @param {string} sessionId @param {string} stage */
export function pastResults(items, sessionId, stage) {
  const latest = items[0];
  const heads = [t("history.when"), t("result.verdict"), t("evidence.captures"), t("history.software"), t("history.beside")];
  return h("table", { class: "number compare" },
    h("thead", {}, h("tr", {}, ...heads.map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, ...items.map((item) => h("tr", {},
      h("th", { scope: "row" }, when(item.created)), h("td", {}, mark(item.verdict, maybe(`verdict.${item.verdict}`, item.verdict))),
      h("td", {}, t("evidence.used_of", { rows: item.used, count: item.captures })), h("td", {}, item.software),
      h("td", {}, item === latest || !latest ? plural(items.length, "history.only", "history.latest") : h("a", { href: compareAddress(sessionId, stage, item.number, latest.number) }, t("result.compare")))))));
}

/** @param {string} sessionId @param {string} stage @param {number} left @param {number} right */
function compareAddress(sessionId, stage, left, right) {
  return `/compare?${new URLSearchParams({ stage, left: `${sessionId}:${left}`, right: `${sessionId}:${right}` })}`;
}
