// Getting captures in: files dropped or chosen, and pose lines. What lays both side by side is loaded with the first of them.

import { h, make } from "../dom.js";
import { chosen, dropped } from "../state/files.js";
import { loaded } from "../state/http.js";
import { t } from "../texts.js";
import { bring, draftKey, isAwaited } from "../state/upload.js";
import { StateElement } from "../components/base.js";
import { attempt } from "../components/toasts.js";

/** @import {Found} from "../state/files.js" */

export class IntakeElement extends StateElement {
  #picker = h("input", { type: "file", multiple: true, class: "visually-hidden", tabindex: -1, "aria-label": t("intake.choose"), onchange: () => this.#chosen(this.#picker) });
  #folderPicker = h("input", { type: "file", webkitdirectory: true, class: "visually-hidden", tabindex: -1, "aria-label": t("intake.folder"), onchange: () => this.#chosen(this.#folderPicker) });
  /** @type {Promise<import("./intake-panel.js").IntakePanelElement> | null} */ #loading = null;
  /** @type {import("./intake-panel.js").IntakePanelElement | null} */ #shown = null;

  parts = /** @type {const} */ (["session"]);

  build() {
    this.append(this.#picker, this.#folderPicker);
  }

  connectedCallback() {
    super.connectedCallback();
    window.addEventListener("beforeunload", this.#warn);
  }

  /** Files that wait are there again for who comes back to the session; a page that is loaded anew has none: its browser asks before. */
  disconnectedCallback() {
    super.disconnectedCallback();
    window.removeEventListener("beforeunload", this.#warn);
    if (this.#unsent.length && !this.state.adding) bring(this.state.id, this.#unsent);
  }

  get #unsent() {
    return this.#shown?.unsent ?? [];
  }

  #warn = (/** @type {Event} */ event) => {
    if (this.#unsent.length || this.state.adding) event.preventDefault();
  };

  update() {
    const { session, id } = this.state;
    if (session && (isAwaited(id) || window.sessionStorage.getItem(draftKey(id)))) void this.#panel();
  }

  #panel() {
    this.#loading ??= loaded(() => import("./intake-panel.js")).then(({ IntakePanelElement }) => {
      const panel = make(IntakePanelElement, { state: this.state });
      panel.addEventListener("solve", () => this.dispatchEvent(new Event("solve")));
      this.append(panel);
      return (this.#shown = panel);
    });
    return this.#loading;
  }

  chooseFiles() {
    this.#picker.click();
  }

  chooseFolder() {
    this.#folderPicker.click();
  }

  /** Open the panel for pose lines. */
  async open() {
    (await this.#panel()).open();
  }

  /** @param {DataTransfer} transfer */
  async drop(transfer) {
    await this.#take(dropped(transfer)); // read at once: what was dropped is gone after the event
  }

  /** @param {HTMLInputElement} input */
  #chosen(input) {
    const found = chosen(input);
    input.value = "";
    void this.#take(found);
  }

  /** @param {Found[] | Promise<Found[]>} coming */
  async #take(coming) {
    await attempt(async () => (await this.#panel()).take(await coming));
  }
}

customElements.define("sc-intake", IntakeElement);
