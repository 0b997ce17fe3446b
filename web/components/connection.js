// Whether the page follows the server at this moment.

import { h } from "../dom.js";
import { t } from "../texts.js";
import { StateElement } from "./base.js";

export class LiveElement extends StateElement {
  parts = /** @type {const} */ (["live"]);

  update() {
    const { live } = this.state;
    this.className = `live live-${live}`;
    this.setAttribute("role", "status");
    this.replaceChildren(h("span", { class: "dot", "aria-hidden": "true" }), t(`live.${live}`));
  }
}

customElements.define("sc-live", LiveElement);
