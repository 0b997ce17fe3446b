// The result of the step that is open: the answer, then how we know, drawn from its evidence.

import { h, make, putChildren } from "../dom.js";
import { t } from "../texts.js";
import { figures } from "../blocks/figure.js";
import { answer, evidenceOf, leading, otherFigures } from "./answer.js";
import { StateElement } from "../components/base.js";
import { later } from "../components/lazy-parts.js";
import { loaded } from "../state/http.js";
import { isTheAnswer } from "../state/standing.js";
import { historySection, resultLinks } from "./history.js";
import { truthSection } from "./truth.js";

/** @import {StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */
/** @import {Renderer} from "../blocks/index.js" */
/** @typedef {(name: string, make: () => HTMLElement) => HTMLElement} Keep answers the same element each time that the page draws itself anew */
/** @typedef {{ blocks?: Record<string, Renderer>, after?: (context: import("../blocks/index.js").Context, keep: Keep) => HTMLElement[], settings?: HTMLElement, approval?: HTMLElement }} StageElements what a stage draws itself */

const SLICE_MS = 16;

export class ResultElement extends StateElement {
  #ended = "";
  #due = true;
  #drawing = 0;
  /** Made once: what is clicked or typed in while it is replaced would be lost. @type {Map<string, HTMLElement>} */
  #kept = new Map();

  parts = /** @type {const} */ (["results", "guide", "selection", "job", "view", "step"]);

  /** @param {ReadonlySet<import("../state/session.js").Part>} changed */
  update(changed) {
    const { job } = this.state;
    if (job?.status === "done" && job.id !== this.#ended) {
      this.#ended = job.id;
      this.#due = true;
    } else if ((changed.has("job") && !this.state.resultOf(this.state.step)) || changed.has("results") || changed.has("step") || changed.has("guide")) this.#due = true;
    // What nobody looks at is drawn once somebody does.
    if (this.closest("[hidden]")) return;
    if (this.#due) void this.#show();
    else if (changed.has("selection")) this.#markPicked();
  }

  /** A section at a time, with a breath after what took long, so that many captures hold nothing up; shown at once. */
  async #show() {
    this.#due = false;
    const drawing = ++this.#drawing;
    const { state } = this;
    const stage = state.stageOf(state.step);
    const result = state.results[stage];
    const empty = (/** @type {"solving" | "loading" | "none"} */ how) => putChildren(this, [h("p", { class: "soft empty", role: "status" }, t(`result.${how}`))]);
    if (!result) return empty(state.without(stage));
    if (this.querySelector(".empty")) empty("loading");
    // What draws evidence is loaded with the first result.
    const [own, { sections }] = await Promise.all([elementsOf(state, stage, this.#keep), loaded(() => import("../blocks/index.js"))]);
    /** @type {HTMLElement[]} */
    const drawn = [];
    let start = performance.now();
    for (const section of this.#sections(stage, result, own, sections)) {
      drawn.push(section);
      if (performance.now() - start < SLICE_MS) continue;
      await new Promise((resolve) => setTimeout(resolve));
      if (drawing !== this.#drawing) return;
      start = performance.now();
    }
    if (drawing !== this.#drawing) return;
    this.#markPicked(drawn);
    putChildren(this, drawn);
  }

  /** @type {Keep} */
  #keep = (name, make) => {
    const kept = this.#kept.get(name) ?? make();
    this.#kept.set(name, kept);
    return kept;
  };

  /** @param {string} stage @param {StageResult} result @param {StageElements} own @param {typeof import("../blocks/index.js").sections} sections @returns {Generator<HTMLElement>} */
  *#sections(stage, result, own, sections) {
    const { state } = this;
    const context = { state, stage };
    yield answer(result, state, stage);
    if (state.session?.simulated && !("timeline" in state)) yield truthSection(state.id, stage);
    const others = otherFigures(result);
    if (others.length) yield h("section", { class: "panel", "aria-label": t("answer.figures") }, figures(others));
    yield* sections(evidenceOf(result).slice(leading(result).length), context, own.blocks);
    if (!evidenceOf(result).length) yield h("p", { class: "soft" }, t("result.no_evidence"));
    if (!("timeline" in state)) {
      yield* own.after?.(context, this.#keep) ?? [];
      if (own.settings) yield own.settings;
      if (own.approval) yield own.approval;
    }
    if ("timeline" in state) return; // the review itself has these
    yield this.#keep(`links of ${stage}`, () => resultLinks(state.id, stage));
    yield historySection(state.id, stage);
  }

  /** @param {readonly Element[]} parts */
  #markPicked(parts = [this]) {
    for (const row of parts.flatMap((part) => [...part.querySelectorAll("tr[data-capture]")])) row.classList.toggle("picked", row.getAttribute("data-capture") === this.state.selected);
  }
}

/** Whether a stage's result is the session's one answer, or its verification. @param {SessionState} state @param {string} stage */
const tellsTheAnswer = (state, stage) => isTheAnswer(state, stage) || (stage === "verify" && state.stages.some(({ name }) => isTheAnswer(state, name)));

/** What a stage draws itself, and the form of its settings; most have neither. @param {SessionState} state @param {string} stage @param {Keep} keep @returns {Promise<StageElements>} */
async function elementsOf(state, stage, keep) {
  const info = state.stages.find(({ name }) => name === stage);
  /** @type {StageElements} */
  let own = info?.element ? (await loaded(() => import(`../stages/${stage}/index.js`))).elements : {};
  if (tellsTheAnswer(state, stage) && !("timeline" in state)) {
    const { ApprovalElement } = await loaded(() => import("./approval.js"));
    own = { ...own, approval: keep("approval", () => make(ApprovalElement, { state })) };
  }
  // What must be known from the start (a board) belongs to the cell.
  const required = /** @type {string[] | undefined} */ (info?.settings["required"]);
  if (!info?.settings_field || required?.length || "timeline" in state) return own;
  const told = JSON.stringify(/** @type {Record<string, unknown>} */ (state.session?.cell ?? {})[info.settings_field]);
  return { ...own, settings: keep(`settings of ${stage} ${told}`, () => later(async () => (await import("./solve-settings.js")).solveSettings(state, info))) };
}

customElements.define("sc-result", ResultElement);
