// The captures that were there at a moment, to look at and to pick, not to change.

import { h, keyed, putChildren } from "../dom.js";
import { plural } from "../texts.js";
import { StateElement } from "../components/base.js";
import { columnsFor } from "../measure/capture-columns.js";
import { residualsOf } from "../measure/captures.js";

export class ReviewCapturesElement extends StateElement {
  #count = h("h2", { id: "review-captures-title" });
  #head = h("tr");
  #body = h("tbody");

  parts = /** @type {const} */ (["captures", "selection", "step"]);

  build() {
    this.append(this.#count, h("div", { class: "table-holder", tabindex: 0, role: "region", "aria-labelledby": "review-captures-title" },
      h("table", { class: "captures", "aria-labelledby": "review-captures-title" }, h("thead", {}, this.#head), this.#body)));
  }

  update() {
    const { stepCaptures: captures, selected } = this.state;
    const residuals = residualsOf(this.state);
    const columns = columnsFor(captures, residuals);
    this.hidden = captures.length === 0;
    this.#count.textContent = plural(captures.length, "captures.one", "captures.many");
    this.#head.replaceChildren(...columns.map(({ title, right }) => h("th", { scope: "col", class: right ? "right" : "" }, title)));
    keyed(this.#body, captures, ({ id }) => id, () => h("tr"), (row, capture) => {
      const residual = residuals.get(capture.id);
      row.classList.toggle("picked", selected === capture.id);
      row.classList.toggle("out", capture.excluded === true || residual?.used === false);
      const told = JSON.stringify([capture.excluded, capture.pose, residual, capture.measured.verdict, columns.length]);
      row.querySelector(".pick")?.setAttribute("aria-pressed", String(selected === capture.id));
      if (row.getAttribute("data-told") === told) return;
      row.setAttribute("data-told", told);
      putChildren(row, () => columns.map((column) => h("td", { class: `${column.name} ${column.right ? "right number" : ""}` }, column.name === "id"
        ? h("button", { type: "button", class: "plain pick", "aria-pressed": String(selected === capture.id), onclick: () => this.state.select(capture.id) }, capture.id)
        : column.cell(capture, residual))));
    });
  }
}

customElements.define("sc-review-captures", ReviewCapturesElement);
