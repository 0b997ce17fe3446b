// The answer first: how good it is, the verdict, what stands against it, and what comes next. Words on demand.

import { figureWords } from "../blocks/figure.js";
import { quantityWords } from "../blocks/quantity.js";
import { h } from "../dom.js";
import { mark } from "../icons.js";
import { maybe, t } from "../texts.js";
import { glossed } from "./glossary.js";
import { stepName } from "./rail.js";
import { causeCards, mendable } from "./remedy.js";

/** @import {Block, FigureBlock, StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const IN_SIGHT = 3;

/** @param {StageResult} result @param {SessionState} state @param {string} stage */
export function answer(result, state, stage) {
  const verdict = result.stale ? "stale" : result.verdict;
  return h(
    "section", { class: `panel answer-card answer-${verdict}`, "aria-labelledby": "answer-title" },
    h("div", { class: "row spread" }, h("h2", { id: "answer-title" }, stepName(state, stage)), mark(verdict, maybe(`verdict.${verdict}`, verdict))),
    h("dl", { class: "headline number" }, ...figuresOf(result).map((figure) => h("div", { class: figure.headline ? "first" : "" }, h("dd", {}, figureWords(figure), figure.limit && h("span", { class: "soft small" }, ` ${t("answer.wanted", { limit: quantityWords(figure.limit) })}`)), h("dt", {}, glossed(figure.label))))),
    ...messages(result),
    causeCards(state, stage, result),
    next(state, stage),
  );
}

/** @param {StageResult} result */
export const evidenceOf = ({ evidence }) => /** @type {Block[]} */ (evidence ?? []);

/** The blocks before the first title: they belong to the answer. @param {StageResult} result */
export function leading(result) {
  const blocks = evidenceOf(result);
  const end = blocks.findIndex(({ title }) => title);
  return end < 0 ? blocks : blocks.slice(0, end);
}

/** @param {StageResult} result */
const figuresOf = (result) => /** @type {FigureBlock[]} */ (leading(result).filter(({ kind }) => kind === "figure"));

/** @param {StageResult} result */
function messages({ stale, warnings = [], notes = [] }) {
  const said = [...(stale ? [t("result.stale_words")] : []), ...(warnings ?? [])];
  const rest = said.slice(IN_SIGHT);
  return [
    said.length > 0 && h("ul", { class: "messages" }, ...said.slice(0, IN_SIGHT).map(message)),
    rest.length > 0 && more(t("answer.more", { count: rest.length }), rest),
    (notes ?? []).length > 0 && more(t("answer.notes", { count: (notes ?? []).length }), notes ?? []),
  ];
}

/** One line each; a longer one opens. @param {string} text */
function message(text) {
  return h("li", {}, h("details", {}, h("summary", { title: text }, text)));
}

/** @param {string} title @param {readonly string[]} texts */
function more(title, texts) {
  return h("details", { class: "more" }, h("summary", { class: "small" }, title), h("ul", {}, ...texts.map((text) => h("li", {}, text))));
}

/** What the guide says comes next, in one line; a reviewed past has none. @param {SessionState} state @param {string} stage */
function next(state, stage) {
  const now = state.guide?.current;
  const result = state.results[stage];
  // Where the main button mends the cause, more captures would not.
  if ("timeline" in state || !now || (now.action === "review" && now.stage === stage) || (result && mendable(result).length)) return null;
  return h("p", { class: "next", title: now.instruction }, h("strong", {}, t("answer.next")), " ", now.instruction);
}
