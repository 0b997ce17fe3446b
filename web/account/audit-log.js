// Who did what, and who was refused what: read a page at a time.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { when } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { attempt } from "../components/toasts.js";

/** @import {AuditEntry} from "../state/model.js" */

const HEADS = /** @type {const} */ (["audit.when", "audit.who", "audit.did", "audit.from", "audit.outcome"]);

export class AuditLogElement extends HTMLElement {
  #rows = h("tbody");
  #none = h("p", { class: "soft", hidden: true }, t("audit.none"));
  #more = h("button", { type: "button", hidden: true, onclick: () => void attempt(() => this.#read()) }, t("audit.more"));
  /** @type {string | null} */ #next = null;

  connectedCallback() {
    if (this.firstChild) return;
    this.append(h("section", { class: "panel audit", "aria-labelledby": "audit-title" },
      h("h2", { id: "audit-title" }, t("review.log")), h("p", { class: "soft small" }, t("audit.what")),
      h("table", { class: "compare" }, h("thead", {}, h("tr", {}, ...HEADS.map((head) => h("th", { scope: "col" }, t(head))))), this.#rows),
      this.#none, h("div", { class: "row" }, this.#more)));
    void attempt(() => this.refresh());
  }

  /** Begin with the newest again. */
  async refresh() {
    this.#next = null;
    await this.#read(true);
  }

  async #read(afresh = false) {
    const { items, next } = await api.audit(this.#next);
    const lines = items.map(line);
    if (afresh) this.#rows.replaceChildren(...lines);
    else this.#rows.append(...lines);
    this.#next = next;
    this.#more.hidden = next === null;
    this.#none.hidden = this.#rows.childElementCount > 0;
  }
}

/** @param {AuditEntry} entry */
function line({ at, who, role, method, path, address, outcome, change }) {
  return h("tr", {},
    h("td", { class: "number" }, h("time", { datetime: at }, when(at))), h("td", {}, `${who} `, h("span", { class: "soft" }, role)),
    h("td", { class: "mono" }, `${method} ${path}`, change && changed(change)), h("td", { class: "number" }, address),
    h("td", {}, mark(outcome === "done" ? "pass" : "fail", t(`audit.${outcome}`))));
}

/** What a request changed, field by field. @param {NonNullable<AuditEntry["change"]>} change */
function changed({ before, after }) {
  const [was, is] = [fieldsOf(before), fieldsOf(after)];
  const names = [...new Set([...was.keys(), ...is.keys()])].filter((name) => was.get(name) !== is.get(name));
  return h("details", {}, h("summary", { class: "small" }, t("audit.changed")), h("ul", { class: "small" }, ...names.map((name) => h("li", {}, `${name}: ${was.get(name) ?? "–"} → ${is.get(name) ?? "–"}`))));
}

/** @param {unknown} value @param {string} [path] @returns {Map<string, string>} */
function fieldsOf(value, path = "") {
  if (value === null || value === undefined) return new Map();
  if (typeof value !== "object" || Array.isArray(value)) return new Map([[path, JSON.stringify(value)]]);
  return new Map(Object.entries(value).flatMap(([name, one]) => [...fieldsOf(one, path ? `${path}.${name}` : name)]));
}

customElements.define("sc-audit-log", AuditLogElement);
