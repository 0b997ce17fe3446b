// What happened, in words and in order; a line leads to its moment.

import "../texts/later.js";
import { h } from "../dom.js";
import { when } from "../format.js";
import { ReviewState } from "../state/review.js";
import { said, t } from "../texts.js";
import { StateElement } from "../components/base.js";
import { itemWords } from "./timeline.js";
import { attempt } from "../components/toasts.js";
import { named } from "../result/release-words.js";

/** @import {TimelineItem} from "../state/model.js" */

const MOST_LINES = 300;
/** What somebody does to a capture and is kept with who, when and why. */
const DEEDS = /** @type {const} */ ([
  ["timeline.added", "added_because"], ["timeline.changed", "changed_because"], ["timeline.left_out", "excluded_because"],
  ["timeline.taken_back", "included_because"], ["timeline.deleted_by", "removed_because"],
]);

export class ReviewLogElement extends StateElement {
  #list = h("ol", { class: "log" });
  #drawn = 0;

  parts = /** @type {const} */ (["place"]);

  build() {
    this.append(h("details", { class: "panel", open: true }, h("summary", {}, t("review.log")), this.#list));
  }

  update() {
    if (!(this.state instanceof ReviewState)) return;
    const { timeline, place } = this.state;
    if (this.#drawn !== timeline.length) {
      this.#drawn = timeline.length;
      this.#list.replaceChildren(...shortened(timeline).map((item) => this.#line(item)));
    }
    for (const line of this.#list.querySelectorAll("button")) line.setAttribute("aria-current", String(Number(line.dataset["place"]) === place));
  }

  /** @param {TimelineItem} item */
  #line(item) {
    const go = () => attempt(async () => (this.state instanceof ReviewState ? this.state.go(item.place) : undefined));
    return h("li", {},
      h("button", { type: "button", class: "plain", "data-place": item.place, onclick: () => void go() }, h("time", { class: "soft number", datetime: item.at }, when(item.at)), ` ${itemWords(item)}`),
      item.message && h("p", { class: "soft small" }, said(item.message)),
      ...DEEDS.map(([name, deed]) => becauseWords(name, item[deed])).map((words) => words && h("p", { class: "soft small" }, words)));
  }
}

/** @param {typeof DEEDS[number][0]} name @param {TimelineItem["excluded_because"]} because */
const becauseWords = (name, because) => because && t(name, { who: named(because.who ?? ""), when: because.when ? when(because.when) : "", why: because.why || t("timeline.no_reason") });

/** Of a long row of captures the first and the last, so that the log stays one to read. @param {TimelineItem[]} timeline */
function shortened(timeline) {
  if (timeline.length <= MOST_LINES) return timeline;
  return timeline.filter(({ kind }, index) => kind !== "capture" || timeline[index - 1]?.kind !== "capture" || timeline[index + 1]?.kind !== "capture");
}

customElements.define("sc-review-log", ReviewLogElement);
