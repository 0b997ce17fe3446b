// What was seen in one capture: the last one, or the one picked in list, plot or scene.

import { h, putChildren } from "../dom.js";
import { fixed, integer, small } from "../format.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";
import { StateElement } from "../components/base.js";
import { statusOf } from "./capture-columns.js";
import { frameCoverage, sharpness } from "./frame-coverage.js";
import { framePlot } from "./frame-plot.js";
import { glossed } from "../components/glossary.js";
import { profilePlot, zoneBar } from "./profile-plot.js";
import { withoutWords } from "../result/exclusion-effect.js";

/** @import {CaptureOut, Residual} from "../state/model.js" */

const MOST_OFFERED = 300;

export class QualityElement extends StateElement {
  /** @type {string | null} the capture that the shown one is compared with */ #other = null;

  parts = /** @type {const} */ (["captures", "selection", "results", "guide"]);

  update() {
    const capture = this.state.shown;
    this.hidden = capture === null;
    if (!capture) return;
    const left = Object.values(this.state.results).flatMap((result) => (result.stale ? [] : /** @type {Residual[]} */ (result.residuals).map((row) => ({ ...row, ofFrames: this.state.showsBoard(result.stage ?? "") })))).find((row) => row.capture === capture.id && !row.used);
    const other = this.state.captures.find((one) => one.id === this.#other && one !== capture) ?? null;
    putChildren(this, () => {
      if (other) void this.#compare(capture, other);
      return [
        h("div", { class: "row spread" }, heading(capture, this.state.selected === capture.id), this.#compareField(capture)),
        body(capture, left, this.state),
        preview(withoutWords(this.state, capture.id)),
        ...frameCoverage(this.state, capture),
      ];
    });
  }

  /** @param {CaptureOut} capture @param {CaptureOut} other */
  async #compare(capture, other) {
    const { compareCaptures } = await import("../compare/capture-comparison.js");
    if (this.state.shown === capture && this.#other === other.id) {
      this.querySelector(".both")?.remove();
      this.append(compareCaptures(this.state, capture, other));
    }
  }

  /** Which capture to set beside this one. @param {CaptureOut} capture */
  #compareField(capture) {
    const others = this.state.captures.filter((one) => one !== capture);
    if (!others.length) return null;
    const pick = (/** @type {Event} */ event) => {
      this.#other = /** @type {HTMLSelectElement} */ (event.currentTarget).value || null;
      this.update();
    };
    // The list of many is made once somebody opens it.
    const offer = () => others.map(({ id }) => h("option", { value: id, selected: id === this.#other }, id));
    const list = h("select", { class: "compare-with", "aria-label": t("both.with", { capture: capture.id }), onchange: pick }, h("option", { value: "" }, t("both.pick")));
    if (others.length <= MOST_OFFERED || this.#other) list.append(...offer());
    else list.addEventListener("focus", () => list.append(...offer()), { once: true });
    return list;
  }
}

/**
 * @param {CaptureOut} capture
 * @param {boolean} picked
 */
function heading(capture, picked) {
  const verdict = capture.measured.verdict;
  return h(
    "h2", {}, h("span", { class: "soft" }, t(picked ? "quality.picked" : "quality.last")), ` ${capture.id} `,
    mark(verdict, maybe(`quality.${verdict}`, verdict)),
  );
}

/**
 * @param {CaptureOut} capture
 * @param {Residual | undefined} left what the solve says that left it out
 * @param {import("../state/session.js").SessionState} state
 */
function body(capture, left, state) {
  const { measured } = capture;
  return h(
    "div", { class: "quality-body" },
    (measured.image_size || (measured.preview ?? []).length > 0) && h("figure", {}, measured.image_size ? framePlot(capture, state.id) : profilePlot(measured, { width: 232, height: 152 }),
      h("button", { type: "button", class: "plain wide small", onclick: async () => (await import("./full-size.js")).fullSize(capture, state) }, t("full.open"))),
    h("div", { class: "quality-words" }, left?.reason ? told(statusOf(capture, left)[0], said(left.reason)) : reason(capture), figures(capture)),
  );
}

/** @param {string | null} words */
const preview = (words) => h("p", { class: "without small soft", hidden: words === null }, words ?? "");

/** @param {CaptureOut} capture */
function reason({ measured }) {
  if (!measured.reason) return null;
  const toDo = measured.to_do ? ` ${said(measured.to_do)}` : "";
  return told(measured.verdict, sentence(said(measured.reason)) + toDo);
}

/** @param {string} verdict @param {string} text */
function told(verdict, text) {
  return h("p", { class: `reason reason-${verdict}` }, sentence(text));
}

/** @param {string} text */
function sentence(text) {
  const start = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?…。]$/.test(start) ? start : `${start}.`;
}

/** @param {CaptureOut} capture */
function figures({ measured }) {
  const { zone, rms_mm, points, on_sphere, extent_deg, point_sigma_mm } = measured;
  return h(
    "dl", { class: "figures" },
    typeof measured.edge_width_px === "number" && figure(t("quality.sharpness"), `${fixed(measured.edge_width_px, 1)} px`, sharpness(measured.edge_width_px)),
    zone !== null && zone !== undefined && figure(t("quality.zone"), fixed(zone, 2), zoneBar(zone)),
    rms_mm !== null && rms_mm !== undefined && figure(t("quality.rms"), small(rms_mm)),
    (points ?? 0) > 0 && figure(t("quality.points"), on_sphere ? t("quality.points_of", { on: integer(on_sphere), all: integer(points ?? 0) }) : integer(points ?? 0)),
    point_sigma_mm !== null && point_sigma_mm !== undefined && figure(t("quality.noise"), small(point_sigma_mm)),
    extent_deg !== null && extent_deg !== undefined && figure(t("quality.extent"), `${fixed(extent_deg, 0)}°`),
    (on_sphere ?? 0) > 0 && figure(t("quality.still"), ...standstill(measured)),
  );
}

/** How far the sphere moved between exposures at one pose, and what to think of it. @param {CaptureOut["measured"]} measured @returns {[string, Node]} */
function standstill({ still }) {
  const soft = (/** @type {string} */ text) => h("span", { class: "small soft" }, text);
  if (!still) return ["", soft(t("quality.still_unknown"))];
  const words = t(still.stands_still ? "quality.still_yes" : "quality.still_no");
  const moved = t("quality.still_moved", { movement: small(still.movement_mm), noise: small(still.noise_mm), exposures: still.exposures });
  return ["", h("span", {}, mark(still.stands_still ? "pass" : "warn", words), h("br"), soft(moved))];
}

/**
 * @param {string} name
 * @param {string} value
 * @param {Node} [extra]
 */
function figure(name, value, extra) {
  return h("div", {}, h("dt", {}, glossed(name)), h("dd", { class: "number" }, value, extra));
}

customElements.define("sc-quality", QualityElement);
