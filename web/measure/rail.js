// The steps as places: each opens its guide, captures, result and scene. Below a step's name stands its answer, where there is one that did not fail.

import { h, putChildren } from "../dom.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";
import { figureWords } from "../blocks/figure.js";
import { StateElement } from "../components/base.js";
import { isRefuted } from "../state/standing.js";

/** @import {FigureBlock, StageResult} from "../state/model.js" */

const SIGNS = /** @type {Record<string, string>} */ ({
  done: "pass", usable: "warn", working: "working", solving: "working", todo: "todo", stale: "stale", failing: "fail", later: "todo", known: "pass", "not-needed": "skipped",
});

export class RailElement extends StateElement {
  #list = h("ol", { class: "rail-steps" });
  #asideList = h("ol", { class: "rail-steps" });
  #aside = h("details", { class: "small soft" }, h("summary", {}, t("status.not-needed")), this.#asideList);

  parts = /** @type {const} */ (["guide", "results", "captures", "step", "job"]);

  build() {
    this.append(h("nav", { "aria-label": t("rail.steps") }, this.#list, this.#aside));
  }

  update() {
    const { state } = this;
    const aside = state.steps.filter((step) => step !== state.step && state.guide?.steps.find((one) => one.step === step)?.status === "not-needed");
    putChildren(this.#list, state.steps.filter((step) => !aside.includes(step)).map((step) => this.#item(step)));
    this.#aside.hidden = aside.length === 0;
    putChildren(this.#asideList, aside.map((step) => this.#item(step)));
  }

  /** @param {string} step */
  #item(step) {
    const told = this.state.guide?.steps.find((one) => one.step === step);
    const result = this.state.resultOf(step);
    const known = told?.status ?? (result ? statusOf(result) : "todo");
    // Done, but not accepted: a tick would promise more than the verdict does.
    const isSolving = !result && this.state.without(this.state.stageOf(step)) === "solving" && this.state.job?.stage === step;
    const usable = known === "done" && result?.verdict === "warn" && this.state.stageOf(step) === step;
    const refuted = known === "done" && isRefuted(this.state, step);
    const status = isSolving ? "solving" : refuted ? "failing" : usable ? "usable" : known;
    const open = step === this.state.step;
    const next = this.state.guide?.current.step === step;
    return h("li", {}, h(
      "button", { type: "button", class: `rail-step status-${status}`, "data-step": step, "aria-current": open && "step", title: refuted ? t("release.fault.verify-fail") : told?.note ? said(told.note) : false, onclick: () => this.state.open(step) },
      mark(SIGNS[status] ?? "todo", stepName(this.state, step)),
      h("span", { class: "status" }, status === "usable" ? t("verdict.warn") : maybe(`status.${status}`, status), next && !open && h("span", { class: "visually-hidden" }, ` ${t("rail.next")}`)),
      result && result.verdict !== "fail" && this.state.stageOf(step) === step && answer(result)));
  }
}

/** What the server calls a step of a cell for which the usual words do not fit. @param {import("../state/session.js").SessionState} state @param {string} step */
export const ownName = (state, step) => said(state.guide?.steps.find((one) => one.step === step)?.title ?? "");

/** @param {import("../state/session.js").SessionState} state @param {string} step */
export function stepName(state, step) {
  return ownName(state, step) || maybe(`step.${step}`, state.stages.find(({ name }) => name === step)?.title ?? step);
}

/** @param {StageResult} result */
function statusOf({ stale, verdict }) {
  if (stale) return "stale";
  return verdict === "fail" ? "failing" : "done";
}

/** The figures that stand first. @param {StageResult} result @returns {FigureBlock[]} */
function headlines({ evidence = [] }) {
  return /** @type {FigureBlock[]} */ ((evidence ?? []).filter((block) => block.kind === "figure" && block.headline));
}

/** @param {StageResult} result */
function answer(result) {
  const found = headlines(result);
  return found.length > 0 && h("span", { class: "answer number" }, ...found.slice(0, 2).map((figure) => h("span", {}, figureWords(figure), /\bRMS\b/.test(figure.label) && " RMS")));
}

customElements.define("sc-rail", RailElement);
