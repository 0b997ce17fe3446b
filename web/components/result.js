// The answer: the frame, what it is worth, how we know.

import { h } from "../dom.js";
import { steps } from "../steps/index.js";
import { t } from "../texts.js";
import { StateElement } from "./base.js";

export class ResultElement extends StateElement {
  get parts() {
    return /** @type {const} */ (["results", "selection"]);
  }

  /** @param {ReadonlySet<import("../state.js").Part>} changed */
  update(changed) {
    if (!changed.has("results")) return this.#markPicked();
    const sections = Object.entries(this.state.results).flatMap(([stage, result]) => steps[stage]?.result(result, this.state) ?? []);
    if (sections.length) this.replaceChildren(...sections.filter((section) => section !== null));
    else this.replaceChildren(h("p", { class: "soft empty" }, t("result.none")));
  }

  #markPicked() {
    for (const point of this.querySelectorAll(".mark-point")) {
      point.classList.toggle("picked", point.getAttribute("data-capture") === this.state.selected);
    }
  }
}

customElements.define("sc-result", ResultElement);
