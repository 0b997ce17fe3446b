// How pasted poses are read: the convention, and what each column of the table is.

import { field, h } from "../dom.js";
import { angleIn, guessRoles, knowConventions, NUMBERS, OTHERS, poseLines, tableOf } from "../state/pose-table.js";
import { maybe, t } from "../texts.js";
import { attempt } from "../components/toasts.js";

/** @import {ConventionInfo, PoseConvention} from "../state/model.js" */
/** @import {Role, Table} from "../state/pose-table.js" */

const SHOWN_ROWS = 3;

export class PoseColumnsElement extends HTMLElement {
  /** Called when the reading changes. @type {() => void} */ changed = () => undefined;
  #text = "";
  /** @type {Table | null} */ #table = null;
  /** @type {Role[]} */ #roles = [];
  #chosen = "";
  #convention = h("select", { onchange: () => this.#convene() });
  #wanted = "";
  #columns = h("div", { class: "columns", role: "region", tabindex: 0, "aria-label": t("columns.label"), hidden: true });

  connectedCallback() {
    if (this.firstChild) return;
    this.append(field("pose-convention", t("columns.convention"), this.#convention), this.#columns);
    void attempt(async () => {
      const known = await knowConventions();
      this.#convention.replaceChildren(...known.map((one) => h("option", { value: one.name }, conventionWords(one))));
      this.#convention.value = this.#chosen || this.#wanted;
      this.#guess();
    });
  }

  /** The convention that the cell has, until another is chosen here. @param {PoseConvention} name */
  set convention(name) {
    this.#wanted = name;
    if (!this.#chosen) this.#convention.value = name;
  }

  /** Another convention than the cell's, as a file has it. @param {PoseConvention} name */
  choose(name) {
    this.#chosen = name;
    this.#convention.value = name;
    this.#guess();
  }

  get convention() {
    return /** @type {PoseConvention} */ (this.#convention.value || this.#wanted);
  }

  /** @param {string} text as it was pasted */
  read(text) {
    if (text === this.#text) return;
    this.#text = text;
    this.#table = tableOf(text);
    this.#guess();
  }

  /** Pose lines for the server: of a table the columns in their order, of anything else the text as it is. */
  get lines() {
    return this.#usable ? poseLines(/** @type {Table} */ (this.#table), this.#roles, this.convention).join("\n") : this.#text;
  }

  /** The table's angle of the pose that stands in a line (from 1). @param {number} line */
  angle(line) {
    return this.#usable && this.#table ? angleIn(this.#table, this.#roles, line - 1) : undefined;
  }

  /** Columns that were swapped: the number k stands in the column that is read as order[k] now. @param {readonly number[]} order */
  reorder(order) {
    const names = NUMBERS[this.convention] ?? [];
    const columns = names.map((name) => this.#roles.indexOf(name));
    names.forEach((name, index) => { this.#roles[columns[order[index] ?? index] ?? 0] = name; });
    this.#draw();
  }

  /** Whether the poses stand in a table whose columns can be told otherwise. */
  get isTable() {
    return this.#usable;
  }

  get #usable() {
    return this.#table !== null && (NUMBERS[this.convention] ?? []).every((name) => this.#roles.includes(name)) && this.convention in NUMBERS;
  }

  #convene() {
    this.#chosen = this.#convention.value;
    this.#guess();
    this.changed();
  }

  #guess() {
    this.#roles = this.#table ? guessRoles(this.#table, this.convention) : [];
    this.#draw();
  }

  #draw() {
    const table = this.#table;
    this.#columns.hidden = !table || (table.rows[0]?.length ?? 0) < (NUMBERS[this.convention]?.length ?? 0);
    if (!table || this.#columns.hidden) return this.#columns.replaceChildren();
    const heads = this.#roles.map((role, column) => h("th", { scope: "col" }, this.#select(role, column)));
    this.#columns.replaceChildren(h("table", { class: "number" },
      h("thead", {}, h("tr", {}, ...heads), table.head && h("tr", {}, ...table.head.map((cell) => h("td", { class: "soft" }, cell)))),
      h("tbody", {}, ...table.rows.slice(0, SHOWN_ROWS).map((row) => h("tr", {}, ...row.map((cell) => h("td", {}, cell)))))));
  }

  /** @param {Role} role @param {number} column */
  #select(role, column) {
    const roles = [...OTHERS.map((one) => [one, t(`columns.${one}`)]), ...(NUMBERS[this.convention] ?? []).map((name) => [name, name])];
    const pick = (/** @type {Event} */ event) => this.#assign(column, /** @type {HTMLSelectElement} */ (event.currentTarget).value);
    return h("select", { "aria-label": t("columns.column", { number: column + 1 }), onchange: pick }, ...roles.map(([value, words]) => h("option", { value, selected: value === role }, words)));
  }

  /** A role is one column's alone: who had it takes what this one had. @param {number} column @param {Role} role */
  #assign(column, role) {
    const other = role === "ignore" ? -1 : this.#roles.indexOf(role);
    if (other >= 0) this.#roles[other] = this.#roles[column] ?? "ignore";
    this.#roles[column] = role;
    this.#draw();
    this.querySelectorAll(/** @type {"select"} */ ("thead select"))[column]?.focus();
    this.changed();
  }
}

/** `FANUC (x y z W P R)`. @param {ConventionInfo} convention */
export function conventionWords({ name, title, numbers }) {
  const words = maybe(`convention.${name}`, title);
  return numbers.length < 10 ? `${words} (${numbers.join(" ")})` : words;
}

customElements.define("sc-pose-columns", PoseColumnsElement);
