// The 3-D scene beside everything: its own document from the same server, in this page's theme.

import { h } from "../dom.js";
import { theme, whenThemeChanges } from "../theme.js";
import { t } from "../texts.js";
import { StateElement } from "./base.js";

export class SceneElement extends StateElement {
  #frame = h("iframe", { title: t("scene.title") });
  #shown = "";
  /** @type {(() => void) | null} */ #stopTheme = null;
  /** @type {string | null} */ #lit = null;

  get parts() {
    return /** @type {const} */ (["session", "selection"]);
  }

  build() {
    this.append(h("p", { class: "scene-wait soft" }, t("scene.wait")), this.#frame);
  }

  connectedCallback() {
    super.connectedCallback();
    this.#stopTheme = whenThemeChanges(() => this.#show());
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.#stopTheme?.();
  }

  update() {
    this.#show();
    if (this.#lit === this.state.selected) return;
    this.#lit = this.state.selected;
    // The scene is an extra: where it cannot light the capture up, the list and the plot still do.
    const body = JSON.stringify({ capture: this.#lit });
    const address = `/scenes/${encodeURIComponent(this.state.id)}/highlight`;
    void fetch(address, { method: "POST", headers: { "Content-Type": "application/json" }, body }).catch(() => undefined);
  }

  #show() {
    const scene = this.state.session?.scene;
    if (!scene) return;
    const address = `${scene}?theme=${theme()}`;
    if (address === this.#shown) return;
    this.#shown = address;
    this.#frame.src = address;
  }
}

customElements.define("sc-scene", SceneElement);
