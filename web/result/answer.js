// The answer first: how good it is, the verdict, what stands against it, and what comes next. Words on demand.

import { figureWords } from "../blocks/figure.js";
import { quantityWords } from "../blocks/quantity.js";
import { coded, h } from "../dom.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";
import { brief } from "./brief.js";
import { explains } from "./finding.js";
import { glossed } from "../components/glossary.js";
import { stepName } from "../measure/rail.js";
import { nextStep } from "../state/next-step.js";
import { isRefuted } from "../state/standing.js";
import { faultMarks } from "./release-words.js";
import { causesOf, evidenceOfCause, mendable } from "./remedy.js";

/** @import {Block, FigureBlock, Finding, StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const IN_SIGHT = 3;
const BESIDE = 2;

/** @param {StageResult} result @param {SessionState} state @param {string} stage */
export function answer(result, state, stage) {
  const verdict = result.stale ? "stale" : result.verdict;
  const failed = verdict === "fail";
  const told = messages(result);
  const figures = h("dl", { class: failed ? "headline number small" : "headline number" }, ...shownFigures(result).map((figure, index) => headline(figure, !failed && figure.headline === true && index < BESIDE)));
  const card = h(
    "section", { class: `panel answer-card answer-${verdict}`, "data-verdict": verdict, "aria-labelledby": "answer-title" },
    h("div", { class: "row spread" }, h("h2", { id: "answer-title" }, stepName(state, stage)), h("div", { class: "standing" })),
    // Of what failed the cause is read first; its number is worth little.
    ...(failed ? [...told, figures] : [figures, ...told]),
    next(state, stage),
  );
  stand(card, isRefuted(state, stage) ? ["verify-fail"] : []);
  return card;
}

/** The verdict, or what speaks against the session's answer: accepted is only what may be used. @param {HTMLElement} card @param {readonly string[]} faults */
export function stand(card, faults) {
  const verdict = card.dataset["verdict"] ?? "";
  const told = ["stale", "fail"].includes(verdict) ? [] : faults;
  card.classList.toggle("against", told.length > 0);
  card.querySelector(".standing")?.replaceChildren(...(told.length ? faultMarks(told) : [mark(verdict, maybe(`verdict.${verdict}`, verdict))]));
}

/** @param {FigureBlock} figure @param {boolean} first */
function headline(figure, first) {
  const limit = figure.limit && (figure.limit_label ? `${said(figure.limit_label)} ${quantityWords(figure.limit)}` : t("answer.wanted", { limit: quantityWords(figure.limit) }));
  return h("div", { class: first ? "first" : "" }, h("dd", {}, figureWords(figure), limit && h("span", { class: "soft small" }, ` ${limit}`)), h("dt", {}, glossed(said(figure.label))));
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

/** At most three in sight: the causes where they are known, and what follows from them on demand. @param {StageResult} result */
function messages(result) {
  const findings = result.findings ?? [];
  const causes = causesOf(result);
  const ofCauses = causes.flatMap(({ id }) => findings.find(({ remedy }) => remedy?.id === id) ?? []);
  const shown = findings.filter((one) => !one.behind && !ofCauses.includes(one));
  const told = [...new Map(shown.filter(({ severity }) => severity !== "note").map((one) => [brief(one.text), one])).values()];
  const notes = shown.filter(({ severity }) => severity === "note");
  const stale = result.stale ? [h("li", {}, h("details", {}, h("summary", {}, brief(t("result.stale_words"))), h("p", {}, t("result.stale_words"))))] : [];
  const room = IN_SIGHT - stale.length;
  const first = ofCauses.length ? ofCauses : told.slice(0, room);
  const rest = ofCauses.length ? told : told.slice(room);
  return [
    stale.length + first.length > 0 && h("ul", { class: "messages" }, ...stale, ...first.slice(0, room).map(message)),
    ...causes.slice(0, 1).flatMap(evidenceOfCause),
    (rest.length > 0 || notes.length > 0) && h("div", { class: "row" },
      rest.length > 0 && more(t("answer.more", { count: rest.length }), rest),
      notes.length > 0 && more(t("answer.notes", { count: notes.length }), notes)),
  ];
}

/** In one line, the whole on demand; what has a remedy by its title. @param {Finding} finding */
function message(finding) {
  const short = brief(said(finding.remedy?.title || finding.text));
  return h("li", {}, h("details", {}, h("summary", {}, ...coded(short)), whole(finding, short)));
}

/** All that is said beyond what stands there already. @param {Finding} finding @param {string} [short] */
const whole = ({ text, to_do, code }, short) => h("p", {}, ...coded(said([said(text).replace(/[.。]$/u, "") === short ? "" : text, to_do].filter(Boolean).join(" "))), " ", explains(code));

/** @param {string} title @param {readonly Finding[]} findings */
function more(title, findings) {
  return h("details", { class: "more" }, h("summary", { class: "small" }, title), h("ul", {}, ...findings.map((one) => h("li", {}, whole(one)))));
}

/** What the guide says comes next, in one line; a reviewed past has none, nor where the main button leads elsewhere. @param {SessionState} state @param {string} stage */
function next(state, stage) {
  const now = state.guide?.current;
  const result = state.results[stage];
  // What is not accepted is mended here first, and where the main button mends the cause, more captures would not.
  if (result && !result.stale && result.verdict !== "pass" && now?.stage !== stage) return null;
  if (stage === "merge" && result && !result.stale && result.verdict === "pass" && !("timeline" in state)) {
    const go = () => document.getElementById("merge-files")?.scrollIntoView({ behavior: "smooth" });
    return h("p", { class: "next" }, h("strong", {}, t("answer.next")), " ", h("button", { type: "button", class: "plain", onclick: go }, t("answer.save")));
  }
  const onward = nextStep(state);
  if (onward !== null && onward !== now?.step) return null;
  if ("timeline" in state || !now || (now.action === "review" && now.stage === stage) || (result && mendable(result).length)) return null;
  return h("p", { class: "next", title: said(now.instruction) }, h("strong", {}, t("answer.next")), " ", brief(said(now.instruction)));
}
