// One thing to do now: its drawing, its reason, how much of it is left, and when it is enough.

import { h, make } from "../dom.js";
import { maybe } from "../texts.js";
import { t } from "../texts.js";
import { StateElement } from "./base.js";
import { DrawingElement } from "./drawing.js";

/** @import {Guide} from "../model.js" */

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
    if (!guide?.current) return;
    this.#drawing.name = guide.current.drawing ?? "cell";
    this.#words.replaceChildren(...words(guide.current));
  }
}

/** @param {NonNullable<Guide["current"]>} current */
function words(current) {
  const parts = [h("p", { class: "guide-progress" }, maybe(`step.${current.step}`, current.step), needed(current))];
  parts.push(h("h1", {}, current.instruction));
  if (current.why) parts.push(h("p", { class: "guide-why" }, h("strong", {}, t("guide.why")), " ", current.why));
  if (current.exit) parts.push(h("p", { class: "guide-exit soft" }, h("strong", {}, t("guide.exit")), " ", current.exit));
  return parts;
}

/** @param {NonNullable<Guide["current"]>} current */
function needed(current) {
  return current.still_needed ? h("span", { class: "soft" }, ` · ${t("guide.needed", { count: current.still_needed })}`) : null;
}

customElements.define("sc-guide", GuideElement);
