// Whether the page follows the server at this moment; if not, since when.

import { h } from "../dom.js";
import { clock } from "../format.js";
import { linked } from "../state/http.js";
import { t } from "../texts.js";
import { StateElement } from "./base.js";

export class LiveElement extends StateElement {
  parts = /** @type {const} */ (["live"]);

  update() {
    const { live, liveSince } = this.state;
    // What is shown of what runs is as old as that.
    document.documentElement.toggleAttribute("data-link-lost", live === "reconnecting");
    if (live === "live") linked(false);
    this.className = `live live-${live}`;
    this.setAttribute("role", "status");
    this.replaceChildren(h("span", { class: "dot", "aria-hidden": "true" }), t(`live.${live}`, { since: clock(liveSince) }));
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    document.documentElement.removeAttribute("data-link-lost");
  }
}

customElements.define("sc-live", LiveElement);
