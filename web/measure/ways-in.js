// A session without captures: one large place for files, and the other two ways to begin.

import { h } from "../dom.js";
import { t } from "../texts.js";
import { StateElement } from "../components/base.js";

/** @import {IntakeElement} from "./intake.js" */

export class WaysInElement extends StateElement {
  /** @type {IntakeElement | null} */ intake = null;
  devices = () => {};

  parts = /** @type {const} */ (["captures", "session"]);

  build() {
    this.append(
      h("p", { class: "soft" }, t("begin.drop")),
      h("div", { class: "row" },
        h("button", { type: "button", needs: "capture", onclick: () => this.intake?.chooseFiles() }, t("begin.files")),
        h("button", { type: "button", needs: "capture", onclick: () => this.devices() }, t("begin.live")),
        h("a", { class: "button", href: "/" }, t("begin.simulated"))));
  }

  update() {
    const { captures, session } = this.state;
    this.hidden = !session || session.simulated || captures.length > 0;
  }
}

customElements.define("sc-ways-in", WaysInElement);
