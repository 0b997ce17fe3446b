// One thing to do now: its drawing, its reason, how much of it is left, and when it is enough.

import { api } from "../state/api.js";
import { h, make, putChildren } from "../dom.js";
import { mark } from "../icons.js";
import { language, said, t } from "../texts.js";
import { nextStep } from "../state/next-step.js";
import { StateElement } from "../components/base.js";
import { copyButton } from "../components/copy.js";
import { DrawingElement } from "./drawing.js";
import { meterSection } from "./meter.js";
import { standsStill } from "./cell-words.js";
import { isToImprove } from "../state/standing.js";
import { stepName } from "./rail.js";
import { mendable } from "../result/remedy.js";
import { attempt } from "../components/toasts.js";

/** @import {GuideNow, RootCause} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

export class GuideElement extends StateElement {
  #drawing = make(DrawingElement);
  #words = h("div", { class: "guide-words", "aria-live": "polite" });

  parts = /** @type {const} */ (["guide", "step", "results"]);

  build() {
    this.append(this.#words, this.#drawing);
  }

  update() {
    const { guide, now, step } = this.state;
    if (!guide) return this.#words.replaceChildren(h("p", { class: "soft" }, t("history.wait")));
    this.#drawing.name = now?.drawing ?? (standsStill(this.state) ? "ball-first" : "cell");
    // What mends a failed result comes before more captures, here as at the result and on the main button.
    const [cause] = mendable(this.state.resultOf(step) ?? {});
    const name = stepName(this.state, step);
    putChildren(this.#words, cause ? remedy(cause, name) : now ? words(now, name, this.state) : this.#elsewhere());
  }

  /** What to do in a step that can be worked on though another comes first. @param {string | undefined} status */
  #open(status) {
    const { state } = this;
    const stage = state.stages.find(({ name }) => name === state.stageOf(state.step));
    return status === undefined || status === "todo" || status === "working" || status === "stale" ? stage?.step?.to_capture : undefined;
  }

  /** A step that asks for nothing now: where it stands, and the way on. */
  #elsewhere() {
    const { state } = this;
    const told = state.guide?.steps.find((one) => one.step === state.step);
    const current = state.guide?.current.step ?? "";
    const open = said(this.#open(told?.status) ?? "") || undefined;
    const usable = told?.status === "done" && isToImprove(state.resultOf(state.step));
    // Back to what is done nobody is sent.
    const asks = state.guide?.steps.find((one) => one.step === current)?.status !== "done";
    return [
      h("p", { class: "guide-progress" }, stepName(state, state.step)),
      h("h1", {}, open ?? t(usable ? "guide.mend" : told?.status === "later" ? "guide.later" : told?.status === "not-needed" || told?.status === "known" ? "guide.not_needed" : "guide.nothing")),
      h("p", { class: "soft" }, told?.note ? said(told.note) : ""),
      state.step === "recheck" && repeated(state.id),
      // Where the main button leads on, once is enough.
      asks && nextStep(state) === null && current !== state.step && h("button", { type: "button", onclick: () => state.open(null) }, t("guide.go_on", { step: stepName(state, current) })),
    ];
  }
}

/** The poses that a recheck captures again. @param {string} sessionId */
function repeated(sessionId) {
  const list = h("ol", { class: "repeated" });
  void attempt(async () => {
    const { poses } = await api.recheckPlan(sessionId);
    list.replaceChildren(...poses.map(({ capture, pose, captured }) => {
      const text = pose.join(" ");
      return h("li", {}, captured ? mark("pass", t("guide.repeated", { capture })) : capture, h("div", { class: "copy-row" }, h("code", {}, text), copyButton(text, t("frame.copy"))));
    }));
  });
  return list;
}

/** @param {RootCause} cause @param {string} name of the step */
const remedy = (cause, name) => [h("p", { class: "guide-progress" }, name), h("h1", {}, `${said(cause.title ?? "")}${language === "zh" ? "。" : "."}`), h("p", { class: "soft" }, said(cause.sentence ?? ""))];

/** @param {GuideNow} now @param {string} name of the step @param {SessionState} state */
function words(now, name, state) {
  const mends = now.action === "review" && isToImprove(state.resultOf(state.step));
  return [
    h("p", { class: "guide-progress" }, name, now.meter ? null : rest(now)),
    h("h1", {}, mends ? t("guide.mend") : said(now.instruction)),
    now.meter ? meterSection(now.meter, state) : null,
    now.why && h("p", { class: "soft" }, said(now.why)),
    now.exit && !mends && h("p", { class: "soft" }, h("strong", {}, t("guide.exit")), " ", said(now.exit)),
    suggestion(now),
  ];
}

/** @param {GuideNow} now */
function rest({ progress, still_needed: needed }) {
  const parts = [progress && said(progress), needed ? t("guide.needed", { count: needed }) : null].filter(Boolean);
  return h("span", { class: "soft" }, ...parts.map((part) => ` · ${part}`));
}

/** A pose that would help, as the controller writes it. @param {GuideNow} now */
function suggestion({ suggested_pose_numbers: numbers, suggested_note: note }) {
  if (!numbers) return null;
  const text = numbers.join(" ");
  return h("div", { class: "suggestion" }, h("strong", {}, t("guide.pose")),
    h("div", { class: "copy-row" }, h("code", {}, text), copyButton(text, t("frame.copy"))),
    note ? h("p", { class: "soft small" }, said(note)) : null);
}

customElements.define("sc-guide", GuideElement);
