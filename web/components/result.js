// The answer: the frame, what it is worth, how we know.

import { h } from "../dom.js";
import { ReviewState } from "../review-state.js";
import { steps } from "../steps/index.js";
import { maybe, t } from "../texts.js";
import { StateElement } from "./base.js";
import { historySection, resultLinks } from "./history.js";

export class ResultElement extends StateElement {
  /** @type {string | null} */ #picked = null;
  #ended = "";

  get parts() {
    return /** @type {const} */ (["results", "selection", "job"]);
  }

  /** @param {ReadonlySet<import("../state.js").Part>} changed */
  update(changed) {
    const { job } = this.state;
    if (job?.status === "done" && job.id !== this.#ended) {
      this.#ended = job.id;
      this.#picked = job.stage;
    } else if (!changed.has("results")) return this.#markPicked();
    this.#show();
  }

  #show() {
    const { results } = this.state;
    const solved = Object.keys(steps).filter((stage) => results[stage]);
    const stage = solved.find((one) => one === this.#picked) ?? solved.at(-1);
    const result = stage && results[stage];
    if (!stage || !result) return this.replaceChildren(h("p", { class: "soft empty" }, t("result.none")));
    const sections = (steps[stage]?.result(result, this.state) ?? []).filter((section) => section !== null);
    const about = this.state instanceof ReviewState ? [] : [resultLinks(this.state.id, stage), historySection(this.state.id, stage)];
    this.replaceChildren(...(solved.length > 1 ? [this.#stages(solved, stage)] : []), ...sections, ...about);
  }

  /** @param {string[]} solved @param {string} shown */
  #stages(solved, shown) {
    const pick = (/** @type {string} */ stage) => {
      this.#picked = stage;
      this.#show();
      this.querySelector(/** @type {"button"} */ (".stages [aria-pressed=true]"))?.focus();
    };
    return h("div", { class: "stages row", role: "group", "aria-label": t("result.stages") }, ...solved.map((stage) =>
      h("button", { type: "button", "aria-pressed": String(stage === shown), onclick: () => pick(stage) }, maybe(`step.${stage}`, stage))));
  }

  #markPicked() {
    for (const point of this.querySelectorAll(".mark-point")) {
      point.classList.toggle("picked", point.getAttribute("data-capture") === this.state.selected);
    }
  }
}

customElements.define("sc-result", ResultElement);
