// The captures that were there at a moment, to look at and to pick, not to change.

import { h, keyed } from "../dom.js";
import { fixed, small } from "../format.js";
import { plural, t } from "../texts.js";
import { StateElement } from "./base.js";
import { pose, status, thumbnail } from "./captures.js";

/** @import {CaptureOut, Residual} from "../model.js" */

const HEADS = /** @type {const} */ (["picture", "id", "pose", "zone", "rms", "state"]);

export class ReviewCapturesElement extends StateElement {
  #count = h("h2", { id: "review-captures-title" });
  #body = h("tbody");

  get parts() {
    return /** @type {const} */ (["captures", "selection"]);
  }

  build() {
    this.append(this.#count, h(
      "table", { class: "captures", "aria-labelledby": "review-captures-title" },
      h("thead", {}, h("tr", {}, ...HEADS.map((head) => h("th", { scope: "col", class: (head === "zone" || head === "rms") && "right" },
        head === "picture" ? h("span", { class: "visually-hidden" }, t("column.picture")) : t(`column.${head}`))))), this.#body));
  }

  update() {
    const { captures, results, selected } = this.state;
    const rows = new Map(Object.values(results).flatMap((result) => /** @type {Residual[]} */ (result.residuals ?? [])).map((row) => [row.capture, row]));
    this.hidden = captures.length === 0;
    this.#count.textContent = plural(captures.length, "captures.one", "captures.many");
    keyed(this.#body, captures, (capture) => capture.id, () => h("tr"), (row, capture) => this.#fill(row, capture, rows.get(capture.id), selected === capture.id));
  }

  /** @param {Element} row @param {CaptureOut} capture @param {Residual | undefined} residual @param {boolean} picked */
  #fill(row, capture, residual, picked) {
    const { measured } = capture;
    const rms = residual?.surface_rms_mm ?? residual?.line_rms_mm ?? measured.rms_mm;
    row.classList.toggle("picked", picked);
    row.classList.toggle("out", capture.excluded === true || residual?.used === false);
    const told = JSON.stringify([capture.excluded, capture.pose, residual, measured.verdict]);
    row.querySelector(".pick")?.setAttribute("aria-pressed", String(picked));
    if (row.getAttribute("data-told") === told) return;
    row.setAttribute("data-told", told);
    row.replaceChildren(
      h("td", { class: "thumb" }, (measured.preview ?? []).length > 0 && thumbnail(capture)),
      h("td", {}, h("button", { type: "button", class: "plain pick", "aria-pressed": String(picked), onclick: () => this.state.select(capture.id) }, capture.id)),
      h("td", { class: "pose" }, pose(capture), residual?.used === false && residual.reason && h("span", { class: "why", title: residual.reason }, residual.reason), !residual && measured.reason && h("span", { class: "why" }, measured.reason)),
      h("td", { class: "right number" }, typeof measured.zone === "number" ? fixed(measured.zone, 2) : "–"),
      h("td", { class: "right number" }, typeof residual?.rms_px === "number" ? `±${fixed(residual.rms_px, 2)} px` : typeof rms === "number" ? `±${small(rms)}` : "–"),
      h("td", { class: "state" }, status(capture, residual)));
  }
}

customElements.define("sc-review-captures", ReviewCapturesElement);
