// What an imported archive held beside session and results: its scene, report, truth, notes, as they came.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { bytes } from "../format.js";
import { t } from "../texts.js";

/** @import {KeptFile} from "../state/model.js" */

// A page from elsewhere is shown only where it needs no script; a kept scene is saved and opened by itself.
const PAGES = ["report.html"];

export class KeptElement extends HTMLElement {
  sessionId = "";

  connectedCallback() {
    this.hidden = true;
    // Most sessions came with no archive: then there is nothing to show, and no need to say so.
    void api.kept(this.sessionId).then((files) => this.#show(files)).catch(() => undefined);
  }

  /** @param {KeptFile[]} files */
  #show(files) {
    this.hidden = files.length === 0;
    this.replaceChildren(h("section", { class: "panel kept", "aria-labelledby": "kept-title" },
      h("h2", { id: "kept-title" }, t("kept.title")), h("p", { class: "soft small" }, t("kept.what")),
      h("ul", {}, ...files.map((file) => this.#line(file)))));
  }

  /** @param {KeptFile} file */
  #line({ name, bytes: size }) {
    const address = api.keptAddress(this.sessionId, name);
    return h("li", {},
      h("a", { href: address, download: name.split("/").at(-1) ?? name }, name), h("span", { class: "soft number" }, ` ${bytes(size)} `),
      PAGES.includes(name) && h("a", { href: `${address}?show=true`, target: "_blank", rel: "noopener", "aria-label": t("kept.open_what", { name }) }, t("kept.open")));
  }
}

customElements.define("sc-kept", KeptElement);
