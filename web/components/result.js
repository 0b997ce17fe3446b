// The answer: the frame, what it is worth, how we know.

import { h } from "../dom.js";
import { steps, STEPS } from "../steps/index.js";
import { maybe, t } from "../texts.js";
import { StateElement } from "./base.js";
import { historySection, resultLinks } from "./history.js";

const SLICE_MS = 16;

export class ResultElement extends StateElement {
  /** @type {string | null} */ #picked = null;
  #ended = "";
  #due = true;
  #drawing = 0;

  get parts() {
    return /** @type {const} */ (["results", "selection", "job", "view"]);
  }

  /** @param {ReadonlySet<import("../state.js").Part>} changed */
  update(changed) {
    const { job } = this.state;
    if (job?.status === "done" && job.id !== this.#ended) {
      this.#ended = job.id;
      this.#picked = job.stage;
      this.#due = true;
    } else if (changed.has("results")) this.#due = true;
    // What nobody looks at is drawn once somebody does.
    if (this.closest("[hidden]")) return;
    if (this.#due) void this.#show();
    else if (changed.has("selection")) this.#markPicked();
  }

  /** A section at a time, with a breath after what took long, so that many captures hold nothing up; shown at once. */
  async #show() {
    this.#due = false;
    const drawing = ++this.#drawing;
    const { results } = this.state;
    const solved = STEPS.filter((stage) => steps[stage] && results[stage]);
    const stage = solved.find((one) => one === this.#picked) ?? solved.at(-1);
    const result = stage && results[stage];
    if (!stage || !result) {
      this.replaceChildren(h("p", { class: "soft empty" }, t("result.none")));
      return;
    }
    /** @type {HTMLElement[]} */
    const drawn = solved.length > 1 ? [this.#stages(solved, stage)] : [];
    let start = performance.now();
    for (const section of this.#sections(stage, result)) {
      if (section) drawn.push(section);
      if (performance.now() - start < SLICE_MS) continue;
      await new Promise((resolve) => setTimeout(resolve));
      if (drawing !== this.#drawing) return;
      start = performance.now();
    }
    const open = new Set(this.#details().filter((one) => one.open).map(title));
    this.replaceChildren(...drawn);
    for (const one of this.#details()) one.open ||= open.has(title(one)); // what somebody has opened stays open
    this.#markPicked();
  }

  /** @returns {HTMLDetailsElement[]} */
  #details() {
    return [...this.querySelectorAll("details")];
  }

  /** @param {string} stage @param {import("../model.js").StageResult} result @returns {Generator<HTMLElement | null>} */
  *#sections(stage, result) {
    yield* steps[stage]?.result(result, this.state) ?? [];
    if ("timeline" in this.state) return; // the review itself has these
    yield resultLinks(this.state.id, stage);
    yield historySection(this.state.id, stage);
  }

  /** @param {string[]} solved @param {string} shown */
  #stages(solved, shown) {
    const pick = async (/** @type {string} */ stage) => {
      this.#picked = stage;
      await this.#show();
      this.querySelector(/** @type {"button"} */ (".stages [aria-pressed=true]"))?.focus();
    };
    return h("div", { class: "stages row", role: "group", "aria-label": t("result.stages") }, ...solved.map((stage) =>
      h("button", { type: "button", "aria-pressed": String(stage === shown), onclick: () => void pick(stage) }, maybe(`step.${stage}`, stage))));
  }

  #markPicked() {
    for (const point of this.querySelectorAll(".mark-point")) {
      point.classList.toggle("picked", point.getAttribute("data-capture") === this.state.selected);
    }
  }
}

/** @param {HTMLDetailsElement} details */
const title = (details) => details.querySelector("summary")?.textContent ?? "";

customElements.define("sc-result", ResultElement);
