// What pasted poses most likely are where they can hardly be what they are read as: in metres, in another convention. Table and
// scene show at once what was taken of it, and there is a way back; nothing is stored.

import "../texts/later.js";
import { h } from "../dom.js";
import { small } from "../format.js";
import { mark } from "../icons.js";
import { lookLikeMetres, readInMetres } from "../state/pose-unit.js";
import { NUMBERS } from "../state/pose-table.js";
import { maybe, t } from "../texts.js";

/** @import {LikelyConvention, PoseLines} from "../state/model.js" */
/** @import {PoseColumnsElement} from "./pose-columns.js" */

export class PoseOffersElement extends HTMLElement {
  /** Called when the reading changes. @type {() => void} */ changed = () => undefined;
  /** @type {PoseColumnsElement | null} */ columns = null;
  #metres = false;
  /** What was taken, and what it was read as before. @type {(LikelyConvention & { before: string }) | null} */ #taken = null;

  /** The order that was taken back, to go back to. @type {readonly number[] | null} */ #swapped = null;

  /** The poses as they are to be used. @param {PoseLines} reading @param {boolean} sphere whether all look at one sphere that stands still */
  take({ items, likely_convention: likely, likely_columns: swapped }, sphere) {
    const { convention } = this.#columns;
    const metres = lookLikeMetres(items, convention);
    this.#metres &&= metres; // other poses
    if (this.#taken?.convention !== convention || !items.length) this.#taken = null;
    if (!items.length) this.#swapped = null;
    this.replaceChildren(...[metres && this.#unit(), sphere && this.#columns.isTable && this.#order(swapped), sphere && !swapped && (likely ? this.#convention(likely) : this.#back())].filter((row) => row instanceof Node));
    return this.#metres ? items.map((pose) => readInMetres(pose, convention)) : items;
  }

  clear() {
    this.#metres = false;
    this.#taken = null;
    this.#swapped = null;
    this.replaceChildren();
  }

  get #columns() {
    if (!this.columns) throw new Error("poses are offered readings without their columns");
    return this.columns;
  }

  #unit() {
    return row(mark(this.#metres ? "pass" : "warn", t(this.#metres ? "intake.metres_read" : "intake.metres")), t(this.#metres ? "intake.millimetres_go" : "intake.metres_go"), () => {
      this.#metres = !this.#metres;
      this.changed();
    });
  }

  /** Columns that were swapped, or the way back. @param {PoseLines["likely_columns"]} likely */
  #order(likely) {
    const order = likely?.order ?? null;
    const names = NUMBERS[this.#columns.convention] ?? [];
    if (order) return row(mark("warn", t("intake.columns", { now: names.join(" "), other: order.map((place) => names[place]).join(" "), spread: small(likely?.spread_mm ?? 0), spread_now: small(likely?.told_spread_mm ?? 0) })), t("intake.columns_go"), () => this.#reorder(order, order), "primary");
    const back = this.#swapped;
    return back && row(mark("pass", t("intake.columns_read")), t("intake.columns_back"), () => this.#reorder(back.map((_, index) => back.indexOf(index)), null));
  }

  /** @param {readonly number[]} order @param {readonly number[] | null} swapped */
  #reorder(order, swapped) {
    this.#columns.reorder(order);
    this.#swapped = swapped;
    this.changed();
  }

  /** @param {LikelyConvention} likely */
  #convention(likely) {
    const before = this.#columns.convention, name = words(likely.convention);
    const told = likely.told_spread_mm ?? null;
    const sentence = t("intake.convention", { name, spread: small(likely.spread_mm) }) + (told === null ? "" : ` ${t("intake.convention_now", { name: words(before), spread: small(told) })}`);
    return row(mark("warn", sentence), t("intake.convention_go", { name }), () => this.#read(likely.convention, { ...likely, before }), "primary");
  }

  #back() {
    if (!this.#taken) return null;
    const { convention, before, spread_mm: spread } = this.#taken;
    return row(mark("pass", t("intake.convention_read", { name: words(convention), spread: small(spread) })), t("intake.convention_go", { name: words(before) }), () => this.#read(before, null));
  }

  /** @param {string} convention @param {(LikelyConvention & { before: string }) | null} taken */
  #read(convention, taken) {
    this.#taken = taken;
    this.#columns.choose(/** @type {import("../state/model.js").PoseConvention} */ (convention));
    this.changed();
  }
}

/** @param {string} convention */
const words = (convention) => maybe(`convention.${convention}`, convention);

/** @param {Node} said @param {string} go @param {() => void} act */
const row = (said, go, act, kind = "") => h("p", { class: "row pose-offer", role: "status" }, said, h("button", { type: "button", class: kind, onclick: act }, go));

customElements.define("sc-pose-offers", PoseOffersElement);
