// What is in force for a cell: its answer, who approved it, when and why; those before it, and the way back to one.

import { api } from "../state/api.js";
import { h } from "../dom.js";
import { when } from "../format.js";
import { may } from "../state/me.js";
import { t } from "../texts.js";
import { faultMarks, releaseWords, sameAnswer, sessionAddress, worth } from "./release-words.js";
import { attempt, notify } from "../components/toasts.js";
import { whyDialog } from "../measure/why-dialog.js";

/** @import {Release} from "../state/model.js" */
/** @typedef {(id: string) => string | undefined} NameOf a session's name; undefined where it was deleted */

/** @param {Release} current @param {NameOf} nameOf @param {() => Promise<void>} after a roll-back */
export function inForce(current, nameOf, after) {
  const list = h("ol", {});
  const earlier = h("details", {}, h("summary", { class: "small" }, t("release.earlier")), list);
  earlier.addEventListener("toggle", () => {
    if (earlier.open) void attempt(async () => list.replaceChildren(...rows(await api.releases(current.cell), nameOf, after)));
  });
  // What speaks against it by now is worked out cell by cell: the list does not wait for it.
  const faults = h("div", { class: "small" });
  void api.inForce(current.cell).then((answer) => faults.replaceChildren(...faultMarks(answer.faults)), () => {});
  return h("section", { class: "in-force", "data-cell": current.cell, "aria-label": t("release.in_force_of", { cell: current.cell }) },
    h("p", { class: "small" }, h("strong", {}, t("release.in_force"))), ...told(current, nameOf), faults, earlier);
}

/** @param {Release} release @param {NameOf} nameOf */
function told(release, nameOf) {
  const name = nameOf(release.session);
  return [
    h("p", { class: "small row" }, name ? h("a", { href: sessionAddress(release.session) }, name) : t("release.removed"), ...worth(release)),
    h("p", { class: "soft small" }, releaseWords(release)),
  ];
}

/** @param {readonly Release[]} releases the newest first @param {NameOf} nameOf @param {() => Promise<void>} after */
function rows([current, ...earlier], nameOf, after) {
  if (!current || !earlier.length) return [h("li", { class: "soft small" }, t("release.earlier_none"))];
  // One way back to each answer: that of its last release.
  const offered = earlier.filter((one, index) => !sameAnswer(one, current) && earlier.findIndex((other) => sameAnswer(one, other)) === index);
  return earlier.map((one) => h("li", {}, ...told(one, nameOf), may("release") && offered.includes(one) && back(one, nameOf(one.session) ?? t("release.removed"), after)));
}

/** @param {Release} release @param {string} session its name @param {() => Promise<void>} after */
function back({ cell, number, solved }, session, after) {
  const place = { session, when: when(solved) };
  const ask = () => whyDialog({ title: t("release.back_title", { cell }), words: [t("release.back_words", place)], go: t("release.back"), act: (why) => api.rollBack(cell, number, why), after: () => {
    notify(t("release.back_done", { session }));
    return after();
  } });
  return h("button", { type: "button", "aria-label": t("release.back_to", place), onclick: ask }, t("release.back"));
}
