// Recomputing: every stage solved afresh, and the stored numbers beside the new ones. Nothing stored is changed.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h, putChildren } from "../dom.js";
import { significant } from "../format.js";
import { mark } from "../icons.js";
import { maybe, pointed, said, t } from "../texts.js";
import { comparisonSections } from "../compare/comparison.js";
import { attempt, say } from "../components/toasts.js";

/** @import {Comparison, Job, Recomputed, StageReplay} from "../state/model.js" */

const ASK_MS = 300;

export class RecomputeElement extends HTMLElement {
  sessionId = "";
  #go = h("button", { type: "button", onclick: () => void this.#run() }, t("recompute.go"));
  #progress = h("div", { class: "job", hidden: true });
  #answer = h("div", { class: "recomputed" });
  #working = false;

  connectedCallback() {
    if (this.firstChild) return;
    this.append(
      h("h2", { id: "recompute-title" }, t("recompute.title")), h("p", { class: "soft small" }, t("recompute.what")),
      h("div", { class: "row" }, this.#go), this.#progress, this.#answer);
  }

  async #run() {
    if (this.#working) return;
    this.#working = true;
    this.#go.setAttribute("aria-disabled", "true");
    await attempt(async () => {
      const ended = await this.#ended(await api.recompute(this.sessionId));
      if (ended.status !== "done") this.#answer.replaceChildren(h("p", { class: "reason reason-fail" }, said(ended.error?.detail ?? "") || t("recompute.cancelled")));
      else this.#show(await api.jobAnswer(ended.id));
    });
    this.#progress.hidden = true;
    this.#go.removeAttribute("aria-disabled");
    this.#working = false;
  }

  /** @param {Job} job */
  async #ended(job) {
    let now = job;
    while (now.status === "queued" || now.status === "running") {
      const cancel = () => attempt(() => api.cancelJob(job.id));
      this.#progress.hidden = false;
      putChildren(this.#progress, [
        h("progress", { max: 1, value: now.progress, "aria-label": t("recompute.running") }), h("span", { class: "small" }, said(now.message ?? "") || t("recompute.running")),
        h("button", { type: "button", needs: "capture", onclick: cancel }, t("cancel"))]);
      await new Promise((resolve) => setTimeout(resolve, ASK_MS));
      now = await api.job(job.id);
    }
    return now;
  }

  /** @param {Recomputed} answer */
  #show({ replay, stages }) {
    const words = t(replay.equal ? "recompute.equal" : "recompute.differs", { software: replay.software, tolerance: replay.tolerance.toExponential(0) });
    say(words);
    this.#answer.replaceChildren(
      h("p", { class: `banner banner-${replay.equal ? "pass" : "warn"}` }, mark(replay.equal ? "pass" : "warn", words)),
      ...replay.stages.flatMap((stage) => [stageSection(stage), ...sideBySide(stage.stage, stages[stage.stage])]));
  }
}

/** @param {string} stage @param {Comparison | undefined} comparison */
function sideBySide(stage, comparison) {
  if (!comparison) return [];
  const names = { left: t("recompute.stored"), right: t("recompute.fresh") };
  return [h("details", { class: "side-by-side" }, h("summary", {}, t("recompute.side_by_side", { stage: maybe(`step.${stage}`, stage) })), ...comparisonSections(comparison, names))];
}

/** @param {StageReplay} stage */
function stageSection({ stage, equal, numbers = 0, largest_relative: largest = 0, difference_count: count = 0, differences = [], why = [] }) {
  const show = (/** @type {unknown} */ value) => (typeof value === "number" ? significantOr(value) : value === null || value === undefined ? "–" : JSON.stringify(value));
  return h(
    "section", { class: "panel" },
    h("h3", {}, `${maybe(`step.${stage}`, stage)} `, mark(equal ? "pass" : "warn", t(equal ? "recompute.stage_equal" : "recompute.stage_differs", { numbers, count, largest: largest.toExponential(1) }))),
    ...why.map((reason) => h("p", {}, said(reason))),
    differences.length ? h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...["recompute.where", "recompute.stored", "recompute.fresh"].map((key, index) => h("th", { scope: "col", class: index > 0 && "right" }, t(/** @type {"recompute.where"} */ (key)))))),
      h("tbody", {}, ...differences.slice(0, 20).map((row) => h("tr", {}, h("th", { scope: "row" }, row.path), h("td", { class: "right" }, show(row.stored)), h("td", { class: "right" }, show(row.fresh)))))) : null);
}

/** @param {number} value */
function significantOr(value) {
  return Math.abs(value) >= 1e-6 || value === 0 ? significant(value, 9) : pointed(value.toExponential(6));
}

customElements.define("sc-recompute", RecomputeElement);
