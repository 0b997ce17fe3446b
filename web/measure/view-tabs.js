// Measuring and its result: two views of one session.

import { h } from "../dom.js";
import { t } from "../texts.js";

/** @import {SessionState} from "../state/session.js" */

const VIEWS = /** @type {const} */ (["measure", "result"]);

/** @param {SessionState} state */
export function viewTabs(state) {
  const tabs = VIEWS.map((view) => h("button", { type: "button", role: "tab", id: `tab-${view}`, "aria-controls": `view-${view}`, onclick: () => state.show(view) }, t(`view.${view}`)));
  const list = h("div", { class: "tabs", role: "tablist", "aria-label": t("view.label"), onkeydown: (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    state.show(state.view === "measure" ? "result" : "measure");
    tabs[VIEWS.indexOf(state.view)]?.focus();
  } }, ...tabs);
  state.watch(["view"], () => tabs.forEach((tab, index) => {
    const chosen = VIEWS[index] === state.view;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }));
  return list;
}
