// The captures of the step that is open: what each gave, whether it counts, and what can be done with one or several.

import { did, next, whenDeedsChange } from "../state/undo.js";
import { h, keyed, putChildren } from "../dom.js";
import { icon } from "../icons.js";
import { plural, said, t } from "../texts.js";
import { StateElement } from "../components/base.js";
import { columnsFor, statusOf } from "./capture-columns.js";
import { copy } from "../components/copy.js";
import { excludeCapture, excludeCaptures, oncePer, withReason } from "./exclude.js";
import { keep } from "./removed-captures.js";
import { isReplaceable } from "./replaceable.js";
import { redoLast, undoLast } from "./undo.js";
import { WindowRows } from "./window-rows.js";

/** @import {Column} from "./capture-columns.js" */
/** @import {CaptureOut, Residual} from "../state/model.js" */

/** In one task; together they fill a screen within a few frames. */
const ROWS_AT_ONCE = 6;
const COLLATOR = new Intl.Collator("en", { numeric: true });

export class CapturesElement extends StateElement {
  #count = h("h2", { id: "captures-title" });
  #head = h("tr");
  #body = h("tbody");
  #table = h("table", { class: "captures", "aria-labelledby": "captures-title" }, h("thead", {}, this.#head), this.#body);
  #filter = h("input", { type: "search", class: "captures-filter", placeholder: t("captures.filter"), "aria-label": t("captures.filter"), oninput: () => this.#changed() });
  #undo = deed("undo", undoLast);
  #redo = deed("redo", redoLast);
  #several = h("div", { class: "several row", role: "group", "aria-label": t("captures.several"), hidden: true });
  #window = new WindowRows(this.#body, () => this.#changed());
  /** @type {Set<string>} */ #chosen = new Set();
  /** @type {{ name: string, down: boolean }} */ #order = { name: "", down: false };
  /** @type {Column[]} */ #columns = [];
  /** @type {(() => void) | null} */ #stopDeeds = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */ #timer;
  /** @type {WeakMap<Element, { capture: CaptureOut, told: string }>} */ #shown = new WeakMap();

  parts = /** @type {const} */ (["captures", "results", "selection", "step"]);

  build() {
    this.append(
      h("div", { class: "row spread" }, this.#count, h("div", { class: "row" }, this.#filter, this.#undo, this.#redo,
        h("button", { type: "button", class: "plain wide", onclick: () => void this.#copyCsv() }, t("captures.csv")))),
      this.#several, h("div", { class: "table-holder", tabindex: 0, role: "region", "aria-labelledby": "captures-title" }, this.#table));
  }

  connectedCallback() {
    super.connectedCallback();
    this.#window.follow(this.closest(".work"));
    this.#stopDeeds = whenDeedsChange(() => this.#offerUndo());
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.#window.leave();
    clearTimeout(this.#timer);
    this.#stopDeeds?.();
  }

  #offerUndo() {
    const { undo, redo } = next();
    for (const [button, what] of /** @type {const} */ ([[this.#undo, undo], [this.#redo, redo]])) {
      button.hidden = what === null;
      if (what === null) continue;
      const words = t(button === this.#undo ? "undo.what" : "redo.what", { what });
      button.setAttribute("aria-label", words);
      button.title = `${words} (${button === this.#undo ? "Ctrl+Z" : "Ctrl+Shift+Z"})`;
    }
    this.hidden = this.state.stepCaptures.length === 0 && undo === null && redo === null;
  }

  #changed() {
    this.update();
  }

  update() {
    const captures = this.state.stepCaptures;
    this.#offerUndo();
    this.#count.textContent = plural(captures.length, "captures.one", "captures.many");
    const residuals = residualsOf(this.state);
    const columns = columnsFor(captures, residuals);
    const names = (/** @type {Column[]} */ all) => all.map(({ name }) => name).join();
    const same = names(columns) === names(this.#columns);
    this.#columns = columns;
    if (!same || !this.#head.firstChild) this.#drawHead();
    if (!same) this.#shown = new WeakMap();
    const found = this.#sorted(captures, residuals);
    this.#table.setAttribute("aria-rowcount", String(found.length + 1));
    /** @type {(() => void)[]} */ const before = [];
    /** @type {(() => void)[]} */ const rest = [];
    const rows = this.#window.of(found), out = new Set(rows.slice(0, this.#window.outOfSight));
    keyed(this.#body, rows, (capture) => capture.id, emptyRow, (row, capture) => {
      const residual = residuals.get(capture.id);
      this.#mark(row, capture);
      if (this.#differs(row, capture, residual)) (out.has(capture) ? before : rest).push(() => this.#fill(row, capture, residual));
    });
    const waiting = [...rest, ...before];
    for (const fill of waiting.splice(0, ROWS_AT_ONCE)) fill();
    this.#fillLater(waiting);
    this.#offerSeveral();
  }

  /** Fill the rest of a long table a few rows at a time, those in sight first, so that the page stays fluid. @param {(() => void)[]} rows */
  #fillLater(rows) {
    clearTimeout(this.#timer);
    if (rows.length === 0) return;
    this.#timer = setTimeout(() => {
      for (const fill of rows.splice(0, ROWS_AT_ONCE)) fill();
      this.#fillLater(rows);
    });
  }

  /** @param {CaptureOut[]} captures @param {Map<string, Residual>} residuals */
  #sorted(captures, residuals) {
    const words = this.#filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = words.length ? captures.filter((capture) => {
      const residual = residuals.get(capture.id);
      const text = [capture.id, capture.mount, said(residual?.reason ?? ""), said(capture.measured.reason ?? ""), statusOf(capture, residual)[1]].join(" ").toLowerCase();
      return words.every((word) => text.includes(word));
    }) : captures;
    const column = this.#columns.find(({ name }) => name === this.#order.name);
    if (!column) return found;
    const sign = this.#order.down ? -1 : 1;
    const valued = found.map((capture) => ({ capture, value: column.value(capture, residuals.get(capture.id)) }));
    return valued.sort((a, b) => sign * compare(a.value, b.value)).map(({ capture }) => capture);
  }

  #drawHead() {
    const all = h("input", { type: "checkbox", "aria-label": t("captures.select_all"), onchange: () => {
      this.#chosen = new Set(all.checked ? this.state.stepCaptures.map(({ id }) => id) : []);
      for (const box of this.#body.querySelectorAll("input.choose")) /** @type {HTMLInputElement} */ (box).checked = all.checked;
      this.#offerSeveral();
    } });
    const hidden = (/** @type {"column.picture"} */ key, name = "deeds") => h("th", { scope: "col", class: name }, h("span", { class: "visually-hidden" }, t(key)));
    putChildren(this.#head, [
      h("th", { scope: "col", class: "select" }, all), hidden("column.picture", "thumb"),
      ...this.#columns.map(({ name, title, right, hint }) => h("th", { scope: "col", class: `${name} ${right ? "right" : ""}`, "aria-sort": this.#order.name === name ? (this.#order.down ? "descending" : "ascending") : "none" },
        h("button", { type: "button", class: "plain sort", "data-column": name, title: hint ?? false, onclick: () => this.#sortBy(name) }, title, this.#order.name === name && (this.#order.down ? " ↓" : " ↑")))),
      h("th", { scope: "col", class: "use" }, t("column.counts")), hidden(/** @type {"column.picture"} */ ("column.delete"))]);
  }

  /** @param {string} name */
  #sortBy(name) {
    this.#order = this.#order.name !== name ? { name, down: false } : this.#order.down ? { name: "", down: false } : { name, down: true };
    this.#drawHead();
    this.update();
  }

  /** @param {Element} row @param {CaptureOut} capture */
  #mark(row, capture) {
    const picked = this.state.selected === capture.id;
    row.classList.toggle("picked", picked);
    row.querySelector(".pick")?.setAttribute("aria-pressed", String(picked));
  }

  /**
   * Rows are filled again only when what they show has changed, so that the focus stays.
   * @param {Element} row
   * @param {CaptureOut} capture
   * @param {Residual | undefined} residual
   */
  #differs(row, capture, residual) {
    const shown = this.#shown.get(row);
    return shown?.capture !== capture || shown.told !== toldOf(capture, residual);
  }

  /**
   * @param {Element} row
   * @param {CaptureOut} capture
   * @param {Residual | undefined} residual
   */
  #fill(row, capture, residual) {
    this.#shown.set(row, { capture, told: toldOf(capture, residual) });
    row.classList.toggle("out", capture.excluded === true || residual?.used === false);
    putChildren(row, () => this.#cells(capture, residual));
    this.#mark(row, capture);
  }

  /** @param {CaptureOut} capture @param {Residual | undefined} residual */
  #cells(capture, residual) {
    const { id } = capture;
    const choose = h("input", { type: "checkbox", class: "choose", "aria-label": t("captures.select", { capture: id }), ".checked": this.#chosen.has(id), onchange: () => {
      if (choose.checked) this.#chosen.add(id);
      else this.#chosen.delete(id);
      this.#offerSeveral();
    } });
    return [
      h("td", { class: "select" }, choose),
      h("td", { class: "thumb" }, columnsFor.picture(capture)),
      ...this.#columns.map((column) => h("td", { class: `${column.name} ${column.right ? "right number" : ""}` }, this.#cell(column, capture, residual))),
      h("td", { class: "use" }, h("input", { type: "checkbox", class: "toggle", needs: "capture", "aria-label": t("captures.use", { capture: id }), ".checked": !capture.excluded, onchange: (/** @type {Event} */ { target }) => excludeCapture(this.state, capture, () => { /** @type {HTMLInputElement} */ (target).checked = !capture.excluded; }) })),
      h("td", { class: "right deeds" }, this.#again(capture), h("button", { type: "button", class: "plain icon remove", needs: "capture", "aria-label": t("captures.remove", { capture: id }), title: t("captures.remove", { capture: id }), onclick: () => this.#remove([capture]) }, icon("trash"))),
    ];
  }

  /** @param {Column} column @param {CaptureOut} capture @param {Residual | undefined} residual */
  #cell(column, capture, residual) {
    if (column.name === "id") return h("button", { type: "button", class: "plain pick", "aria-pressed": String(this.state.selected === capture.id), onclick: () => this.state.select(capture.id) }, capture.id);
    if (column.name !== "table") return column.cell(capture, residual);
    const words = String(column.cell(capture, residual));
    return h("button", { type: "button", class: "plain table-place number", needs: "capture", "aria-label": t("captures.table", { capture: capture.id, place: words }), onclick: async () => (await import("./table-dialog.js")).tableDialog(this.state, capture) }, words);
  }

  /** The way to take it again from the same pose. @param {CaptureOut} capture */
  #again(capture) {
    const simulated = this.state.session?.simulated === true;
    if (!isReplaceable(capture, simulated, this.state.shows(capture.step).startsWith("sphere"))) return null;
    const words = t(simulated ? "captures.again" : "captures.redo", { capture: capture.id });
    return h("button", { type: "button", class: "plain icon redo", needs: "capture", "aria-label": words, title: words, onclick: async () => (await import("./replace.js")).replaceCapture(this.state, capture) }, icon("again"));
  }

  #offerSeveral() {
    const chosen = this.state.stepCaptures.filter(({ id }) => this.#chosen.has(id));
    this.#several.hidden = chosen.length === 0;
    if (!chosen.length) return;
    const exclude = (/** @type {boolean} */ excluded) => void excludeCaptures(this.state, chosen, excluded);
    putChildren(this.#several, [
      h("strong", {}, t("captures.selected", { count: chosen.length })),
      h("button", { type: "button", needs: "capture", onclick: () => exclude(true) }, t("captures.exclude")),
      h("button", { type: "button", needs: "capture", onclick: () => exclude(false) }, t("captures.include")),
      h("button", { type: "button", needs: "capture", onclick: async () => (await import("../equipment/circumstances.js")).temperatureDialog(this.state.id, chosen) }, t("circumstances.captures")),
      h("button", { type: "button", needs: "capture", onclick: () => void this.#remove(chosen) }, t("captures.delete"))]);
  }

  /** @param {readonly CaptureOut[]} captures */
  async #remove(captures) {
    const { remove, restore } = keep(this.state.id, captures);
    const [first] = captures;
    const act = async (/** @type {string} */ why) => {
      await remove(why);
      for (const { id } of captures) this.#chosen.delete(id);
      this.#offerSeveral();
      did(captures.length === 1 && first ? t("captures.removed", { capture: first.id }) : t("captures.removed_many", { count: captures.length }), restore, { tell: true, redo: () => remove(why) });
    };
    await oncePer(captures, () => withReason(this.state, { title: t("captures.remove_decided"), go: t("captures.delete"), act }));
  }

  /** What stands in the table, as it is sorted and filtered. */
  async #copyCsv() {
    const residuals = residualsOf(this.state), convention = this.state.session?.cell.pose_convention;
    if (!convention) return;
    const { capturesAsCsv } = await import("./captures-csv.js");
    await copy(await capturesAsCsv(this.#sorted(this.state.stepCaptures, residuals), this.#columns, residuals, convention));
  }
}

/** As high as one that is filled: else the table moves while it is scrolled. */
const emptyRow = () => h("tr");

/** What the open step's result says of each capture; what is out of date says nothing. @param {import("../state/session.js").SessionState} state */
export function residualsOf(state) {
  const own = state.resultOf(state.step);
  const results = [...Object.values(state.results), ...(own ? [own] : [])].filter(({ stale }) => !stale || "timeline" in state);
  return new Map(results.flatMap(({ stage, residuals = [] }) => /** @type {Residual[]} */ (residuals).map((row) => /** @type {const} */ ([row.capture, { ...row, ofFrames: state.showsBoard(stage ?? "") }]))));
}

/** @param {string | number | null} a @param {string | number | null} b */
function compare(a, b) {
  if (a === null || b === null) return Number(a === null) - Number(b === null);
  return typeof a === "number" && typeof b === "number" ? a - b : COLLATOR.compare(String(a), String(b));
}

/** @param {"undo" | "redo"} what @param {() => Promise<void>} act */
function deed(what, act) {
  return h("button", { type: "button", class: "plain icon", needs: "capture", hidden: true, onclick: () => void act() }, icon(what));
}

customElements.define("sc-captures", CapturesElement);

/** What a row says beside the capture's own record, in the page's language as far as it is known by now. @param {CaptureOut} capture @param {Residual | undefined} residual */
const toldOf = ({ measured }, residual) => JSON.stringify([residual ?? null, said(residual?.reason ?? ""), said(measured.reason ?? "")]);
