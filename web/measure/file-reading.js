// What the reader takes from the scanner's files before they are used: columns, unit, how sure it is; another word counts.

import "../texts/later.js";
import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { field, h } from "../dom.js";
import { mark } from "../icons.js";
import { profilePlot } from "./profile-plot.js";
import { offered } from "../state/registries.js";
import { maybe, said, t } from "../texts.js";

/** @import {Found} from "../state/files.js" */
/** @import {Capture, FileReading, Measured, SessionOut} from "../state/model.js" */

const UNITS = ["mm", "m", "cm", "um", "in"];
const IN_MM = /** @type {Record<string, number>} */ ({ mm: 1, m: 1000, cm: 10, um: 0.001, in: 25.4 });
/** How much wider than the sphere what a scanner sees is, at least and at most. */
const LIKELY = [0.2, 30];

export class FileReadingElement extends HTMLElement {
  /** @type {Found | null} */ #file = null;
  #kind = "profile";
  #looked = "";
  #diameter_mm = 0;
  #format = h("select", {});
  #unit = h("select", {}, h("option", { value: "" }, t("reading.as_it_says")), ...UNITS.map((unit) => h("option", { value: unit }, unit)));
  #columns = h("input", { id: "reading-columns", autocomplete: "off", "aria-describedby": "reading-columns-hint" });
  #said = h("div", {});
  #form = h("details", {},
    h("summary", {}, t("reading.otherwise")),
    field("reading-format", t("reading.format"), this.#format),
    field("reading-unit", t("reading.unit"), this.#unit),
    h("div", { class: "field" }, h("label", { for: "reading-columns" }, t("columns.label")), h("span", { class: "hint", id: "reading-columns-hint" }, t("reading.columns_hint")), this.#columns),
    h("button", { type: "button", onclick: () => void this.#look() }, t("reading.again")));

  /** Look at the first file that came; all of one intake are read alike. @param {readonly Found[]} found @param {SessionOut["cell"] | undefined} cell @param {(path: string) => string} kindOf */
  async look(found, cell, kindOf) {
    this.#diameter_mm = Number(cell?.sphere_diameter_mm ?? 0);
    const file = found.find(({ path }) => kindOf(path) === "profile" || kindOf(path) === "cloud");
    if (!file || this.#looked === file.path) return;
    [this.#file, this.#kind, this.#looked] = [file, kindOf(file.path), file.path];
    const formats = await offered("formats");
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
  #show(reading) {
    const { sure, doubts, notes, preview, points } = reading;
    const doubtful = sure === "doubtful";
    const seen = /** @type {Measured} */ (/** @type {unknown} */ ({ capture: this.#file?.path ?? "", kind: this.#kind, points, preview }));
    this.#said.replaceChildren(
      h("p", {}, mark(doubtful ? "warn" : "pass", `${this.#file?.path}: ${this.#readWords(reading)}`)),
      doubts.length + notes.length > 0 ? h("ul", { class: "messages" }, ...[...doubts, ...notes].map((one) => h("li", {}, said(one)))) : "",
      preview.length > 0 ? h("figure", { class: "reading-preview" }, profilePlot(seen, { width: 232, height: 120 })) : "",
      h("p", { class: "row" }, ...this.#offers(reading)));
    if (doubtful) this.#form.open = true;
  }

  /** What was read, in one line. @param {FileReading} reading */
  #readWords({ format, kind, points, missing, grid, columns, unit, unit_from: from }) {
    const title = [...this.#format.options].find(({ value }) => value === format)?.text ?? format;
    return [
      t("reading.read", { title, points, kind: maybe(`reading.kind_${kind}`, kind) }),
      grid ? t("reading.grid", { rows: grid[0] ?? 0, columns: grid[1] ?? 0 }) : "",
      missing ? t("reading.missing", { count: missing }) : "",
      Object.entries(columns).map(([axis, name]) => `${axis} = ${said(name)}`).join(", "),
      t("reading.in_unit", { unit, from: maybe(`reading.from_${from}`, from) }),
    ].filter(Boolean).join(t("reading.join"));
  }

  /** What is likely meant where it cannot be meant so: another unit; and the columns the other way round. @param {FileReading} reading */
  #offers({ unit, low_mm: low, high_mm: high, columns }) {
    const width_mm = Math.max(...(high ?? []).map((value, axis) => value - (low?.[axis] ?? 0)), 0);
    const share = (/** @type {string} */ one) => (width_mm / this.#diameter_mm) * ((IN_MM[one] ?? 1) / (IN_MM[unit] ?? 1));
    const fits = (/** @type {string} */ one) => share(one) > (LIKELY[0] ?? 0) && share(one) < (LIKELY[1] ?? 0);
    const units = this.#diameter_mm > 0 && width_mm > 0 && unit in IN_MM && !fits(unit) ? UNITS.filter(fits) : [];
    const [first, second, ...more] = Object.keys(columns).filter((name) => ["x", "y", "z"].includes(name));
    const offers = units.map((one) => h("button", { type: "button", class: "primary", onclick: () => {
      this.#unit.value = one;
      void this.#look();
    } }, t("reading.read_as", { name: one })));
    if (first && second && !more.length) offers.push(h("button", { type: "button", onclick: () => {
      const now = this.#settings.columns ?? [first, second];
      this.#columns.value = [...now].reverse().join(" ");
      void this.#look();
    } }, t("reading.swap", { first, second })));
    return offers;
  }
}

customElements.define("sc-file-reading", FileReadingElement);
