// The answer first: how good it is, the verdict, what stands against it, and what comes next. Words on demand.

import { figureWords } from "../blocks/figure.js";
import { quantityWords } from "../blocks/quantity.js";
import { h } from "../dom.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";
import { glossed } from "./glossary.js";
import { stepName } from "./rail.js";
import { causesOf, mendable } from "./remedy.js";

/** @import {Block, FigureBlock, StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const IN_SIGHT = 3;
const BESIDE = 2;
/** A message in one line; all of it opens. */
const MOST_WORDS = 12;
/** A direction: numbers in brackets. */
const DIRECTION = /\([\u2212-]?\d[\d.,]*[,;] [^)a-z]*\)/g;
/** Letters of a word, where words are long: a line is full by letters then. */
const LONGEST_WORD = 6;

/** @param {StageResult} result @param {SessionState} state @param {string} stage */
export function answer(result, state, stage) {
  const verdict = result.stale ? "stale" : result.verdict;
  return h(
    "section", { class: `panel answer-card answer-${verdict}`, "aria-labelledby": "answer-title" },
    h("div", { class: "row spread" }, h("h2", { id: "answer-title" }, stepName(state, stage)), mark(verdict, maybe(`verdict.${verdict}`, verdict))),
    h("dl", { class: "headline number" }, ...shownFigures(result).map((figure, index) => h("div", { class: figure.headline && index < BESIDE ? "first" : "" }, h("dd", {}, figureWords(figure), figure.limit && h("span", { class: "soft small" }, ` ${figure.limit_label ? `${said(figure.limit_label)} ${quantityWords(figure.limit)}` : t("answer.wanted", { limit: quantityWords(figure.limit) })}`)), h("dt", {}, glossed(said(figure.label)))))),
    ...messages(result),
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

/** The headline, and what stands beside it. @param {StageResult} result */
function shownFigures(result) {
  const all = figuresOf(result);
  const first = all.filter(({ headline }) => headline).slice(0, 2);
  return [...first, ...all.filter((figure) => !first.includes(figure)).slice(0, Math.max(0, BESIDE + 1 - first.length))];
}

/** What the answer has no room for; it opens the evidence. @param {StageResult} result @returns {FigureBlock[]} */
export function otherFigures(result) {
  const shown = shownFigures(result);
  return figuresOf(result).filter((figure) => !shown.includes(figure));
}

/** @param {StageResult} result */
function messages(result) {
  const { stale, warnings = [], notes = [] } = result;
  const told = grouped([...(stale ? [t("result.stale_words")].map((text) => ({ text, short: brief(text) })) : []), ...(warnings ?? []).map((text) => ({ text: said(text), short: brief(said(reason(text))) }))]);
  // Where the cause is known it stands alone: what follows from it is told on demand.
  const [cause] = causesOf(result);
  const first = cause ? [] : told.slice(0, IN_SIGHT);
  const rest = told.filter((one) => !first.includes(one)).map(({ text }) => text);
  return [
    cause && h("ul", { class: "messages" }, message(said(cause.sentence), brief(said(cause.title)))),
    first.length > 0 && h("ul", { class: "messages" }, ...first.map(({ text, short }) => message(text, short))),
    (rest.length > 0 || (notes ?? []).length > 0) && h("div", { class: "row" },
      rest.length > 0 && more(t("answer.more", { count: rest.length }), rest),
      (notes ?? []).length > 0 && more(t("answer.notes", { count: (notes ?? []).length }), (notes ?? []).map(said))),
  ];
}

/** Each message once. @param {readonly { text: string, short: string }[]} told */
const grouped = (told) => [...new Map(told.map((one) => [one.short, one])).values()];

/** Of what is not used, what was found instead of what it takes: `p03 is not used: no board`. */
const REFUSED = /^(.+? not used)[^:]*: need .+?, got (.+?)\. .*$/s;

/** What a sentence of the server says at once. @param {string} text */
const reason = (text) => text.replace(REFUSED, "$1: $2.");

/** What a message says, in one line: its first sentence, up to where a clause ends. @param {string} text */
function brief(text) {
  // What stood in brackets is left out, and what is left of a list of it; a direction stays, with as many digits as a glance takes.
  const [sentence = text] = text.replace(DIRECTION, (found) => found.replace(/\d([.,])\d\d/g, (one, sign) => Number(one.replace(",", ".")).toFixed(1).replace(".", sign))).replace(/\s*\((?![\u2212-]?\d[\d.,]*[,;] [^)]*\))[^)]*\)/g, "").replace(/[,、]?\s*(?:and|und|和)(?=[:：])/gu, "").split(/(?<=[.!?])\s+(?=[A-ZÄÖÜ])|[。！？]/u);
  const bare = sentence.replace(/[.。]$/u, "");
  const count = (/** @type {string} */ text, words = text.replace(/ \([^)]*\)/g, "")) => Math.max(words.split(" ").length, words.length / LONGEST_WORD);
  if (count(bare) <= MOST_WORDS) return bare;
  const ends = [...bare.matchAll(/[:;,](?=\s)(?![^(]*\))/g)].map(({ index }) => bare.slice(0, index)).filter((clause) => count(clause) > 4 && count(clause) <= MOST_WORDS);
  return ends.at(-1) ?? `${bare.split(" ").slice(0, MOST_WORDS - 3).join(" ")} …`;
}

/** @param {string} text @param {string} short */
function message(text, short) {
  if (short === text.replace(/\.$/, "")) return h("li", {}, short);
  return h("li", {}, h("details", {}, h("summary", {}, short), h("p", {}, text)));
}

/** @param {string} title @param {readonly string[]} texts */
function more(title, texts) {
  return h("details", { class: "more" }, h("summary", { class: "small" }, title), h("ul", {}, ...texts.map((text) => h("li", {}, text))));
}

/** What the guide says comes next, in one line; a reviewed past has none. @param {SessionState} state @param {string} stage */
function next(state, stage) {
  const now = state.guide?.current;
  const result = state.results[stage];
  // What is not accepted is mended here first, and where the main button mends the cause, more captures would not.
  if (result && !result.stale && result.verdict !== "pass" && now?.stage !== stage) return null;
  if (stage === "merge" && result && !result.stale && result.verdict === "pass" && !("timeline" in state)) {
    const go = () => document.getElementById("merge-files")?.scrollIntoView({ behavior: "smooth" });
    return h("p", { class: "next" }, h("strong", {}, t("answer.next")), " ", h("button", { type: "button", class: "plain", onclick: go }, t("answer.save")));
  }
  if ("timeline" in state || !now || (now.action === "review" && now.stage === stage) || (result && mendable(result).length)) return null;
  return h("p", { class: "next", title: said(now.instruction) }, h("strong", {}, t("answer.next")), " ", brief(said(now.instruction)));
}
