// The time line: a mark for each capture and solve, and one control that moves through them by mouse, touch and keys.

import "../texts/later.js";
import { h, s } from "../dom.js";
import { when } from "../format.js";
import { icon } from "../icons.js";
import { ReviewState } from "../state/review.js";
import { maybe, t } from "../texts.js";
import { StateElement } from "../components/base.js";
import { attempt } from "../components/toasts.js";

/** @import {TimelineItem} from "../state/model.js" */

const STEP_MS = 700;
const MOST_MARKS = 400;
/** Half of the control's handle: marks stand where the handle's middle comes to lie. */
const EDGE = 8;

export class TimelineElement extends StateElement {
  #marks = h("div", { class: "timeline-marks", "aria-hidden": "true" });
  #slide = h("input", { type: "range", min: 0, step: 1, value: 0, "aria-label": t("timeline.label"), oninput: () => this.#go(Number(this.#slide.value)) });
  #words = h("p", { class: "timeline-words", "aria-live": "polite" });
  #back = arrow("back", () => this.#go(this.#review.wanted - 1));
  #forward = arrow("forward", () => this.#go(this.#review.wanted + 1));
  #play = h("button", { type: "button", class: "timeline-play", onclick: () => this.#toggle() });
  #timer = 0;
  #drawn = 0;

  parts = /** @type {const} */ (["place"]);

  get #review() {
    if (!(this.state instanceof ReviewState)) throw new Error("a time line needs a review");
    return this.state;
  }

  build() {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", t("timeline.label"));
    this.append(
      h("div", { class: "row timeline-buttons" }, this.#back, this.#play, this.#forward),
      h("div", { class: "timeline-line" }, this.#marks, this.#slide),
      this.#words);
    this.#show(false);
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    window.clearInterval(this.#timer);
  }

  update() {
    const { timeline, place, item, wanted } = this.#review;
    if (!item) return;
    if (this.#drawn !== timeline.length) this.#draw(timeline);
    this.#slide.max = String(timeline.length - 1);
    this.#slide.value = String(wanted);
    const words = t("timeline.words", { at: place + 1, all: timeline.length, what: itemWords(item), when: when(item.at) });
    this.#slide.setAttribute("aria-valuetext", words);
    this.#words.textContent = words;
    this.#back.setAttribute("aria-disabled", String(place <= 0));
    this.#forward.setAttribute("aria-disabled", String(place >= timeline.length - 1));
    for (const mark of this.#marks.querySelectorAll("[data-place]")) mark.classList.toggle("past", Number(mark.getAttribute("data-place")) <= place);
  }

  /** @param {TimelineItem[]} timeline */
  #draw(timeline) {
    this.#drawn = timeline.length;
    const x = (/** @type {number} */ place) => (timeline.length < 2 ? 0.5 : place / (timeline.length - 1));
    // Of thousands of captures as many are marked as can be told apart; every solve is.
    const stride = Math.ceil(timeline.length / MOST_MARKS);
    const marked = timeline.filter((item) => item.kind !== "capture" || item.place % stride === 0);
    this.#marks.replaceChildren(...marked.map((item) => {
      const mark = s("svg", { class: `timeline-mark ${item.kind} ${item.verdict ?? ""}`, viewBox: "-8 -8 16 16", width: 16, height: 16, "data-place": item.place }, shape(item));
      mark.style.left = `calc(${EDGE}px + (100% - ${2 * EDGE}px) * ${x(item.place)} - 8px)`;
      return mark;
    }));
  }

  /** @param {number} place */
  #go(place) {
    void attempt(() => this.#review.go(place));
  }

  #toggle() {
    const plays = this.#timer !== 0;
    window.clearInterval(this.#timer);
    this.#timer = 0;
    if (!plays) {
      if (this.#review.place >= this.#review.timeline.length - 1) this.#go(0);
      this.#timer = window.setInterval(() => this.#next(), STEP_MS);
    }
    this.#show(!plays);
  }

  #next() {
    if (this.#review.place >= this.#review.timeline.length - 1) this.#toggle();
    else this.#go(this.#review.place + 1);
  }

  /** @param {boolean} plays */
  #show(plays) {
    this.#play.replaceChildren(icon(plays ? "pause" : "play"), t(plays ? "timeline.pause" : "scene.play"));
  }
}

/** @param {"back" | "forward"} way @param {() => void} act */
function arrow(way, act) {
  return h("button", { type: "button", class: "icon", "aria-label": t(`timeline.${way}`), title: t(`timeline.${way}`), onclick: act }, icon(way));
}

/** @param {TimelineItem} item */
function shape(item) {
  if (item.kind === "result") return s("path", { d: "M0 -7L7 0L0 7L-7 0Z" });
  if (item.kind === "failed" || item.kind === "cancelled" || item.kind === "removed") return s("path", { class: "line", d: "M-4 -4L4 4M4 -4L-4 4" });
  if (item.kind === "release" || item.kind === "acknowledged") return s("path", { d: "M-5 0L-1 4L6 -5L-1 -1Z" });
  if (item.kind === "now") return s("path", { class: "line", d: "M0 -7V7" });
  return s("circle", { r: 3 });
}

/**
 * What an item says: a capture, a solve, a failure.
 * @param {TimelineItem} item
 */
export function itemWords(item) {
  const stage = maybe(`step.${item.stage}`, item.stage ?? "");
  const verdict = item.verdict ? maybe(item.kind === "capture" ? `quality.${item.verdict}` : `verdict.${item.verdict}`, item.verdict) : "";
  if (item.kind === "capture") return t(item.removed ? "timeline.removed" : "timeline.capture", { capture: item.capture ?? "", verdict });
  if (item.kind === "removed") return t("timeline.deleted", { capture: item.capture ?? "" });
  if (item.kind === "result") return t("timeline.result", { stage, verdict });
  if (item.kind === "limit") return t("timeline.limit");
  if (item.kind === "release") return t("release.title");
  if (item.kind === "acknowledged") return t("timeline.acknowledged");
  if (item.kind === "now") return t("timeline.now");
  return t(item.kind === "failed" ? "timeline.failed" : "timeline.cancelled", { stage });
}

customElements.define("sc-timeline", TimelineElement);
