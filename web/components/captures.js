// The captures of the session: what each gave, whether it counts, and the ways to leave it out or take it back.

import { api } from "../api.js";
import { h, keyed } from "../dom.js";
import { fixed, small } from "../format.js";
import { icon, mark } from "../icons.js";
import { maybe, plural, t } from "../texts.js";
import { did, lastDeed, undoLast, whenDeedsChange } from "../undo.js";
import { isReplaceable, replaceCapture } from "../replace.js";
import { StateElement } from "./base.js";
import { pointsPlot } from "./frame-plot.js";
import { profilePlot } from "./profile-plot.js";
import { tableDialog } from "./table-dialog.js";
import { attempt } from "./toasts.js";

/** @import {CaptureOut, Residual} from "../model.js" */

const ROWS_AT_ONCE = 40;

export class CapturesElement extends StateElement {
  #count = h("h2", { id: "captures-title" });
  #body = h("tbody");
  #table = h(
    "table", { class: "captures", "aria-labelledby": "captures-title" },
    h("thead", {}, h("tr", {}, ...columns())), this.#body,
  );

  #undo = h("button", { type: "button", class: "plain wide", needs: "capture", hidden: true, onclick: () => void undoLast() }, icon("undo"), t("undo.button"));
  /** @type {(() => void) | null} */ #stopDeeds = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */ #timer;
  /** @type {WeakMap<Element, { capture: CaptureOut, told: string }>} */ #shown = new WeakMap();

  get parts() {
    return /** @type {const} */ (["captures", "results", "selection"]);
  }

  build() {
    this.append(h("div", { class: "row spread" }, this.#count, this.#undo), this.#table);
  }

  connectedCallback() {
    super.connectedCallback();
    this.#stopDeeds = whenDeedsChange(() => this.#offerUndo());
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.#stopDeeds?.();
  }

  #offerUndo() {
    const last = lastDeed();
    this.#undo.hidden = last === null;
    this.hidden = this.state.captures.length === 0 && last === null;
    this.#table.hidden = this.state.captures.length === 0;
    this.#table.classList.toggle("with-redo", this.state.captures.some((capture) => isReplaceable(capture, this.state.session?.simulated === true)));
    const words = t("undo.what", { what: last ?? "" });
    this.#undo.setAttribute("aria-label", words);
    this.#undo.title = `${words} (Ctrl+Z)`;
  }

  update() {
    const { captures } = this.state;
    this.#offerUndo();
    this.#count.textContent = plural(captures.length, "captures.one", "captures.many");
    const residuals = this.#residuals();
    /** @type {(() => void)[]} */ const later = [];
    let filled = 0;
    keyed(this.#body, captures, (capture) => capture.id, () => h("tr"), (row, capture) => {
      const residual = residuals.get(capture.id);
      this.#mark(row, capture);
      if (!this.#differs(row, capture, residual)) return;
      if (filled++ < ROWS_AT_ONCE) this.#fill(row, capture, residual);
      else later.push(() => this.#fill(row, capture, residual));
    });
    this.#fillLater(later);
  }

  /** Fill the rest of a long table a few rows at a time, so that the page stays fluid. @param {(() => void)[]} rows */
  #fillLater(rows) {
    clearTimeout(this.#timer);
    if (rows.length === 0) return;
    this.#timer = setTimeout(() => {
      for (const fill of rows.splice(0, ROWS_AT_ONCE)) fill();
      this.#fillLater(rows);
    });
  }

  #residuals() {
    const rows = Object.values(this.state.results).flatMap((result) => (result.stale ? [] : /** @type {Residual[]} */ (result.residuals ?? [])));
    return new Map(rows.map((row) => [row.capture, row]));
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
    return shown?.capture !== capture || shown.told !== JSON.stringify(residual ?? null);
  }

  /**
   * @param {Element} row
   * @param {CaptureOut} capture
   * @param {Residual | undefined} residual
   */
  #fill(row, capture, residual) {
    const told = JSON.stringify(residual ?? null);
    this.#shown.set(row, { capture, told });
    const focused = row.contains(document.activeElement) ? document.activeElement?.className : "";
    row.classList.toggle("out", capture.excluded === true || residual?.used === false);
    row.replaceChildren(...this.#cells(capture, residual, this.state.selected === capture.id));
    if (focused) /** @type {HTMLElement | null} */ (row.querySelector(`.${focused.split(" ").at(-1)}`))?.focus();
  }

  /**
   * @param {CaptureOut} capture
   * @param {Residual | undefined} residual
   * @param {boolean} picked
   */
  #cells(capture, residual, picked) {
    const { measured } = capture;
    const rms = residual?.surface_rms_mm ?? residual?.line_rms_mm ?? measured.rms_mm;
    return [
      h("td", { class: "thumb" }, (measured.preview ?? []).length > 0 && thumbnail(capture)),
      h("td", {}, h("button", { type: "button", class: "plain pick", "aria-pressed": String(picked), onclick: () => this.state.select(capture.id) }, capture.id)),
      h("td", { class: "pose" }, this.#place(capture), pose(capture), residual?.used === false && residual.reason && h("span", { class: "why", title: residual.reason }, residual.reason)),
      h("td", { class: "right number" }, measured.zone === null || measured.zone === undefined ? "–" : fixed(measured.zone, 2)),
      h("td", { class: "right number" }, typeof residual?.rms_px === "number" ? `±${fixed(residual.rms_px, 2)} px` : rms === null || rms === undefined ? "–" : `±${small(rms)}`),
      h("td", { class: "state" }, status(capture, residual)),
      h("td", { class: "use" }, this.#toggle(capture)),
      h("td", { class: "right deeds" }, this.#redo(capture), h("button", { type: "button", class: "plain icon remove", needs: "capture", "aria-label": t("captures.remove", { capture: capture.id }), title: t("captures.remove", { capture: capture.id }), onclick: () => this.#remove(capture) }, icon("trash"))),
    ];
  }

  /** The way to take it again from the same pose. @param {CaptureOut} capture */
  #redo(capture) {
    const simulated = this.state.session?.simulated === true;
    if (!isReplaceable(capture, simulated)) return null;
    const words = t(simulated ? "captures.again" : "captures.redo", { capture: capture.id });
    return h("button", { type: "button", class: "plain icon redo", needs: "capture", "aria-label": words, title: words, onclick: () => replaceCapture(this.state, capture) }, icon("redo"));
  }

  /** Where the table stood, and the way to correct it. @param {CaptureOut} capture */
  #place(capture) {
    if (capture.step !== "turntable" && typeof capture.table_deg !== "number") return null;
    const angle = typeof capture.table_deg === "number" ? `${fixed(capture.table_deg, Number.isInteger(capture.table_deg) ? 0 : 3)}°` : t("captures.no_angle");
    const words = capture.mount ? `${angle} · ${capture.mount}` : angle;
    return h("button", { type: "button", class: "plain table-place number", needs: "capture", "aria-label": t("captures.table", { capture: capture.id, place: words }), onclick: () => tableDialog(this.state.id, capture) }, words);
  }

  /** @param {CaptureOut} capture */
  #toggle(capture) {
    const { id } = this.state;
    const excluded = capture.excluded === true;
    const change = () => attempt(async () => {
      await api.changeCapture(id, capture.id, { excluded: !excluded });
      did(t(excluded ? "captures.taken_in" : "captures.left_out", { capture: capture.id }), () => api.changeCapture(id, capture.id, { excluded: capture.excluded ?? null }));
    });
    return h("input", { type: "checkbox", class: "toggle", needs: "capture", "aria-label": t("captures.use", { capture: capture.id }), ".checked": !capture.excluded, onchange: change });
  }

  /** @param {CaptureOut} capture */
  async #remove(capture) {
    const { id } = this.state;
    await attempt(async () => {
      const { measured: _, ...record } = capture;
      const files = await Promise.all((capture.files ?? []).map((name) => api.captureFile(id, capture.id, name)));
      await api.removeCapture(id, capture.id);
      did(t("captures.removed", { capture: capture.id }), () => api.addCapture(id, record, files), { tell: true });
    });
  }
}

function columns() {
  const heads = /** @type {const} */ (["picture", "id", "pose", "zone", "rms", "state", "counts", "delete"]);
  const hidden = new Set(["picture", "delete"]);
  const right = new Set(["zone", "rms"]);
  return heads.map((head) => {
    const text = t(`column.${head}`);
    return h("th", { scope: "col", class: right.has(head) && "right" }, hidden.has(head) ? h("span", { class: "visually-hidden" }, text) : text);
  });
}

/** @param {CaptureOut} capture */
export function thumbnail(capture) {
  const plot = capture.measured.image_size ? pointsPlot(capture) : profilePlot(capture.measured, { width: 48, height: 28, scale: false, most: 60 });
  plot.removeAttribute("role");
  plot.removeAttribute("aria-label");
  plot.setAttribute("aria-hidden", "true");
  return plot;
}

/** @param {CaptureOut} capture */
export function pose({ pose: numbers, step }) {
  if (!numbers) return step === "camera" || step === "laser-plane" ? null : h("span", { class: "soft" }, t("captures.no_pose"));
  const text = numbers.map((number) => fixed(number, Math.abs(number) < 4 ? 3 : 1)).join("  ");
  return h("span", { class: "number", title: numbers.join(" ") }, text);
}

/**
 * @param {CaptureOut} capture
 * @param {Residual | undefined} residual
 */
export function status(capture, residual) {
  if (capture.excluded) return mark("todo", t("captures.excluded"));
  if (residual?.used === false) return mark("fail", t("captures.rejected"));
  if (residual) return mark("pass", t("captures.used"));
  const { verdict } = capture.measured;
  return mark(verdict, maybe(`quality.${verdict}`, verdict));
}

customElements.define("sc-captures", CapturesElement);
