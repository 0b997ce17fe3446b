// What the reader takes from the scanner's files before they are used: columns, unit, how sure it is; another word counts.

import { api, Problem } from "../state/api.js";
import { h } from "../dom.js";
import { mark } from "../icons.js";
import { kindOf } from "../state/files.js";
import { registry } from "../state/registries.js";
import { t } from "../texts.js";

/** @import {Found} from "../state/files.js" */
/** @import {Capture, FileReading} from "../state/model.js" */

const UNITS = ["mm", "m", "cm", "um", "in"];

export class FileReadingElement extends HTMLElement {
  /** @type {Found | null} */ #file = null;
  #kind = "profile";
  #looked = "";
  #format = h("select", { id: "reading-format" });
  #unit = h("select", { id: "reading-unit" }, h("option", { value: "" }, t("reading.as_it_says")), ...UNITS.map((unit) => h("option", { value: unit }, unit)));
  #columns = h("input", { id: "reading-columns", autocomplete: "off", "aria-describedby": "reading-columns-hint" });
  #said = h("div", {});
  #form = h("details", {},
    h("summary", {}, t("reading.otherwise")),
    h("div", { class: "field" }, h("label", { for: "reading-format" }, t("reading.format")), this.#format),
    h("div", { class: "field" }, h("label", { for: "reading-unit" }, t("reading.unit")), this.#unit),
    h("div", { class: "field" }, h("label", { for: "reading-columns" }, t("reading.columns")), h("span", { class: "hint", id: "reading-columns-hint" }, t("reading.columns_hint")), this.#columns),
    h("button", { type: "button", onclick: () => void this.#look() }, t("reading.again")));

  /** Look at the first file that came; all of one intake are read alike. @param {readonly Found[]} found @param {string | null | undefined} scannerKind */
  async look(found, scannerKind) {
    const file = found.find(({ path }) => kindOf(path, scannerKind) === "profile" || kindOf(path, scannerKind) === "cloud");
    if (!file || this.#looked === file.path) return;
    [this.#file, this.#kind, this.#looked] = [file, kindOf(file.path, scannerKind), file.path];
    const formats = await registry("formats");
    this.#format.replaceChildren(h("option", { value: "" }, t("reading.as_it_says")), ...formats.filter(({ reads }) => reads).map(({ name, title }) => h("option", { value: name }, title)));
    await this.#look();
  }

  clear() {
    this.#file = null;
    this.#looked = this.#unit.value = this.#columns.value = this.#format.value = "";
    this.replaceChildren();
  }

  /** What a capture's record keeps of what was said. @returns {Partial<Capture>} */
  get record() {
    const settings = this.#settings;
    return { ...(this.#format.value ? { format: this.#format.value } : {}), ...(Object.keys(settings).length ? { format_settings: settings } : {}) };
  }

  get #settings() {
    const columns = this.#columns.value.split(/[\s,;]+/).filter(Boolean);
    return { ...(this.#unit.value ? { unit: this.#unit.value } : {}), ...(columns.length ? { columns } : {}) };
  }

  async #look() {
    if (!this.#file) return;
    try {
      this.#show(await api.readScannerFile(this.#file, this.#kind, this.#format.value, this.#settings));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      this.#said.replaceChildren(h("p", {}, mark("fail", error.message)));
      this.#form.open = true;
    }
    this.replaceChildren(h("section", { class: "file-reading", "aria-label": t("reading.label") }, this.#said, this.#form));
  }

  /** @param {FileReading} reading */
  #show({ sure, sentence, doubts, notes }) {
    const doubtful = sure === "doubtful";
    this.#said.replaceChildren(
      h("p", {}, mark(doubtful ? "warn" : "pass", `${this.#file?.path}: ${sentence}`)),
      doubts.length + notes.length > 0 ? h("ul", { class: "messages" }, ...[...doubts, ...notes].map((one) => h("li", {}, one))) : "");
    if (doubtful) this.#form.open = true;
  }
}

customElements.define("sc-file-reading", FileReadingElement);
