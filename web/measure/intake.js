// Getting captures in: files dropped or chosen, and pose lines. What lays both side by side is loaded with the first of them.

import { h, make } from "../dom.js";
import { chosen, dropped } from "../state/files.js";
import { t } from "../texts.js";
import { draftKey, isAwaited } from "../state/upload.js";
import { StateElement } from "../components/base.js";
import { attempt } from "../components/toasts.js";

/** @import {Found} from "../state/files.js" */

export class IntakeElement extends StateElement {
  #picker = h("input", { type: "file", multiple: true, class: "visually-hidden", tabindex: -1, "aria-label": t("intake.choose"), onchange: () => this.#chosen(this.#picker) });
  #folderPicker = h("input", { type: "file", webkitdirectory: true, class: "visually-hidden", tabindex: -1, "aria-label": t("intake.folder"), onchange: () => this.#chosen(this.#folderPicker) });
  /** @type {Promise<import("./intake-panel.js").IntakePanelElement> | null} */ #loading = null;

  parts = /** @type {const} */ (["session"]);

  build() {
    this.append(this.#picker, this.#folderPicker);
  }

  update() {
    const { session, id } = this.state;
    if (session && (isAwaited(id) || window.sessionStorage.getItem(draftKey(id)))) void this.#panel();
  }

  #panel() {
    this.#loading ??= import("./intake-panel.js").then(({ IntakePanelElement }) => {
      const panel = make(IntakePanelElement, { state: this.state });
      panel.addEventListener("solve", () => this.dispatchEvent(new Event("solve")));
      this.append(panel);
      return panel;
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
