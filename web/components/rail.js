// The steps with their status, and below them the answer as far as it is known.

import { h } from "../dom.js";
import { mark } from "../icons.js";
import { maybe, t } from "../texts.js";
import { steps } from "../steps/index.js";
import { StateElement } from "./base.js";

/** @import {GuideStep} from "../model.js" */

const SIGNS = /** @type {Record<string, string>} */ ({
  done: "pass", working: "working", todo: "todo", stale: "stale", failing: "fail", later: "todo", known: "pass", "not-needed": "skipped",
});

export class RailElement extends StateElement {
  #list = h("ol", { class: "rail-steps" });
  #answer = h("div", { class: "rail-answer" });

  get parts() {
    return /** @type {const} */ (["guide", "results", "captures", "view"]);
  }

  build() {
    this.append(
      h("nav", { "aria-label": t("rail.steps") }, this.#list),
      h("section", { "aria-labelledby": "rail-answer" }, h("h2", { id: "rail-answer" }, t("rail.result")), this.#answer),
    );
  }

  update() {
    const current = this.state.guide?.current?.step;
    this.#list.replaceChildren(...(this.state.guide?.steps ?? []).map((step) => item(step, step.step === current)));
    const summaries = Object.entries(this.state.results).flatMap(([stage, result]) => steps[stage]?.summary(result, this.state) ?? []);
    this.#answer.replaceChildren(...(summaries.length ? summaries : [h("p", { class: "soft small answer-none" }, t("rail.nothing"))]));
  }
}

/**
 * @param {GuideStep} step
 * @param {boolean} current
 */
function item(step, current) {
  const name = maybe(`step.${step.step}`, step.step);
  return h(
    "li", { class: `rail-step status-${step.status}`, "aria-current": current && "step" },
    mark(SIGNS[step.status] ?? "todo", name),
    h("span", { class: "status", title: step.note ?? false }, maybe(`status.${step.status}`, step.status)),
  );
}

customElements.define("sc-rail", RailElement);
