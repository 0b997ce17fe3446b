// One thing to do now: its drawing, its reason, how much of it is left, and when it is enough.

import { h, make } from "../dom.js";
import { maybe, t } from "../texts.js";
import { StateElement } from "./base.js";
import { copyButton } from "./copy.js";
import { DrawingElement } from "./drawing.js";

/** @import {GuideNow} from "../model.js" */

export class GuideElement extends StateElement {
  #drawing = make(DrawingElement);
  #words = h("div", { class: "guide-words", "aria-live": "polite" });

  get parts() {
    return /** @type {const} */ (["guide"]);
  }

  build() {
    this.append(this.#words, this.#drawing);
  }

  update() {
    const { guide } = this.state;
    if (!guide) return;
    this.#drawing.name = guide.current.drawing;
    this.#words.replaceChildren(...words(guide.current));
  }
}

/** @param {GuideNow} now */
function words(now) {
  return [
    h("p", { class: "guide-progress" }, maybe(`step.${now.step}`, now.step), rest(now)),
    h("h1", {}, now.instruction),
    reason(t("guide.why"), now.why),
    reason(t("guide.exit"), now.exit),
    suggestion(now),
  ].filter((part) => part !== null);
}

/** @param {GuideNow} now */
function rest({ progress, still_needed: needed }) {
  const parts = [progress, needed ? t("guide.needed", { count: needed }) : null].filter(Boolean);
  return h("span", { class: "soft" }, ...parts.map((part) => ` · ${part}`));
}

/** @param {string} name @param {string} text */
function reason(name, text) {
  return text ? h("p", { class: "soft" }, h("strong", {}, name), " ", text) : null;
}

/** A pose that would help, as the controller writes it. @param {GuideNow} now */
function suggestion({ suggested_pose_numbers: numbers, suggested_note: note }) {
  if (!numbers) return null;
  const text = numbers.join(" ");
  return h("div", {},
    h("details", { class: "suggestion" }, h("summary", {}, t("guide.pose")),
      h("div", { class: "copy-row" }, h("code", {}, text), copyButton(text, t("frame.copy")))),
    note ? h("p", { class: "soft small" }, note) : null,
  );
}

customElements.define("sc-guide", GuideElement);
