// The live cell: its devices, what the scanner sees now, one large sign, and captures taken at standstill.

import "../texts/later.js";
import { ago, live, followPreviews, OLD_S } from "../state/live.js";
import { StateElement } from "../components/base.js";
import { zoneBar } from "../measure/profile-plot.js";
import { stepName } from "../measure/rail.js";
import { addedWithReason } from "../measure/add-reason.js";
import { attempt } from "../components/toasts.js";
import { field, h, make, style, whenLetGo } from "../dom.js";
import { fixed, integer, small, typedNumber } from "../format.js";
import { said, t } from "../texts.js";

/** @import {Preview} from "../state/live.js" */
/** @import {SessionState} from "../state/session.js" */

const { DevicesElement } = await import("./devices.js");
const { SignElement } = await import("./sign.js");
const { TableElement } = await import("./table.js");
const { drawPreview } = await import("./view.js");

const RATE_OVER_MS = 1000;
const LOOK_MS = 250;
const LONGEST_PRESS_MS = 400;
/** @type {Preview} */
const NOTHING = { version: 0, step: "", devices: [], automatic: false, waits_for: "", is_taken: false, robot: null, table_deg: null, exposure: null, clocks: null, last: null, image: false };
style("live");

class LivePanelElement extends StateElement {
  #devices = make(DevicesElement);
  #sign = make(SignElement);
  #table = make(TableElement);
  #canvas = h("canvas", { role: "img", "aria-label": t("preview.image"), hidden: true });
  #nothing = h("p", { class: "soft" }, t("preview.nothing"));
  #rate = h("p", { class: "soft small live-rate" });
  #advice = h("div", {});
  #figures = h("dl", { class: "figures" });
  #automatic = h("input", { type: "checkbox", id: "live-automatic", needs: "capture", onchange: () => void this.#set() });
  #sounds = h("input", { type: "checkbox", id: "live-sound", onchange: () => { this.#sign.sounds = this.#sounds.checked; } });
  #step = h("select", { onchange: () => void this.#set() });
  #mount = h("input", { autocomplete: "off", onchange: () => void this.#set() });
  #angle = h("input", { inputmode: "decimal", autocomplete: "off" });
  #now = h("button", { type: "button", class: "primary", needs: "capture", onclick: () => void this.#capture() }, t("capture.now"));
  #seconds = h("input", { inputmode: "decimal", autocomplete: "off", value: "5" });
  #sweep = h("button", { type: "button", needs: "capture", onclick: () => void this.#record() }, t("capture.sweep"));
  #mountField = field("live-mount", t("capture.mount"), this.#mount);
  #angleField = field("live-angle", t("place.angle"), this.#angle);
  /** @type {number[]} */ #drawnMs = [];
  /** @type {Promise<unknown>} */ #sent = Promise.resolve();
  #told = "";
  /** @type {Preview | null} */ #last = null;
  #lastMs = performance.now();
  #timer = 0;
  /** @type {(() => void) | null} */ #stopPreviews = null;

  parts = /** @type {const} */ (["devices", "session"]);

  build() {
    this.#devices.sessionId = this.#table.sessionId = this.state.id;
    const large = h("button", { type: "button", onclick: () => void this.#sign.requestFullscreen?.().catch(() => undefined) }, t("sign.large"));
    this.append(h("section", { class: "panel live-panel", "aria-labelledby": "live-title" },
      h("div", { class: "row spread" }, h("h2", { id: "live-title" }, t("devices.title")),
        h("span", { class: "row" },
          h("button", { type: "button", needs: "admin", onclick: () => void this.#devices.add() }, t("devices.add")), large,
          h("button", { type: "button", class: "plain", onclick: () => this.#close() }, t("close")))),
      h("p", { class: "soft small" }, t("devices.how")),
      this.#devices, this.#sign,
      h("figure", { "aria-label": t("preview.title") }, this.#canvas, this.#nothing, this.#rate),
      this.#advice, this.#figures,
      h("div", { class: "row live-capture" },
        h("div", { class: "row" }, this.#automatic, h("label", { for: "live-automatic" }, t("capture.automatic"))),
        h("div", { class: "row" }, this.#sounds, h("label", { for: "live-sound" }, t("menu.sound"))),
        h("button", { type: "button", needs: "capture", title: t("clocks.how"), onclick: () => void attempt(() => live.measureClocks(this.state.id)) }, t("clocks.measure"))),
      h("div", { class: "row live-capture" },
        field("live-step", t("intake.step"), this.#step), this.#mountField, this.#angleField, this.#now,
        field("live-seconds", t("capture.seconds"), this.#seconds), this.#sweep),
      this.#table));
  }

  connectedCallback() {
    super.connectedCallback();
    void this.#load();
    this.#stopPreviews = followPreviews(this.state.id, (preview, image) => this.#show(preview, image));
    this.#timer = window.setInterval(() => this.#age(), LOOK_MS);
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.#stopPreviews?.();
    window.clearInterval(this.#timer);
  }

  update() {
    if (this.isConnected && this.#step.firstChild) void this.#devices.load();
  }

  async #load() {
    await attempt(async () => {
      const { capture } = await live.devices(this.state.id);
      const steps = this.state.captureSteps;
      this.#step.replaceChildren(...steps.map((one) => h("option", { value: one, selected: one === capture.step }, stepName(this.state, one))));
      this.#automatic.checked = capture.automatic === true;
      this.#mount.value = capture.mount ?? "";
      this.#fields();
    });
  }

  #fields() {
    const shown = this.state.shows(this.#step.value);
    this.#mountField.hidden = shown !== "sphere-on-table";
    this.#angleField.hidden = !["sphere-on-table", "object"].includes(shown) || this.#devices.items.some(({ delivers, connected_for }) => delivers.includes("table") && connected_for === this.state.id);
  }

  async #set() {
    this.#fields();
    const step = /** @type {"tcp"} */ (this.#step.value);
    const mount = this.#mountField.hidden ? null : this.#mount.value.trim() || null;
    const settings = { automatic: this.#automatic.checked, step, mount };
    this.#sent = this.#sent.then(() => attempt(() => live.set(this.state.id, settings)));  // two at once may arrive in either order
    await this.#sent;
  }

  async #capture() {
    await this.#take(this.#now, "capture.waiting", (angle) => live.capture(this.state.id, angle));
  }

  async #record() {
    const seconds = typedNumber(this.#seconds.value);
    this.#seconds.setCustomValidity(seconds > 0 ? "" : t("form.need_number"));
    if (this.#seconds.reportValidity()) await this.#take(this.#sweep, "capture.recording", (angle) => live.sweep(this.state.id, { seconds, ...angle }));
  }

  /** @param {HTMLElement} button @param {"capture.waiting" | "capture.recording"} meanwhile @param {(told: { table_deg?: number, why?: string }) => Promise<unknown>} take */
  async #take(button, meanwhile, take) {
    const before = button.textContent;
    button.setAttribute("aria-disabled", "true");
    button.textContent = t(meanwhile);
    const angle = typedNumber(this.#angle.value);
    const own = this.#angleField.hidden || !this.#angle.value.trim() ? {} : { table_deg: angle };
    await addedWithReason(this.state, (why) => take({ ...own, ...(why ? { why } : {}) }));
    button.textContent = before;
    button.removeAttribute("aria-disabled");
  }

  #close() {
    window.localStorage.removeItem(`scancell-live-${this.state.id}`);
    this.remove();
  }

  /** @param {Preview} preview @param {ImageBitmap | null} image */
  async #show(preview, image) {
    await whenLetGo(LONGEST_PRESS_MS); // a first picture moves what stands below it, and a press there would be lost
    this.#last = preview;
    this.#lastMs = performance.now();
    this.#age();
    this.#table.hidden = !this.#table.isArmed && !preview.devices.some(({ delivers, status }) => delivers.includes("table") && status === "live");
    const { exposure } = preview;
    this.#canvas.hidden = !exposure;
    this.#nothing.hidden = exposure !== null;
    drawPreview(this.#canvas, preview, image);
    this.#measureRate(preview);
    const told = JSON.stringify([exposure?.zone?.toFixed(2), exposure?.rms_mm?.toFixed(3), exposure?.extent_deg?.toFixed(0), exposure?.picture?.exposure_advice, exposure?.picture?.stripe_width_px?.toFixed(1), exposure?.problem, exposure?.weak, preview.clocks, preview.table_deg?.toFixed(2), preview.robot?.base_from_tool0?.map((row) => row[3]?.toFixed(1)), (preview.robot?.age_s ?? 0) > OLD_S]);
    if (told === this.#told) return;
    this.#told = told;
    this.#advice.replaceChildren(...advice(preview).map((one) => h("p", { class: "reason" }, said(one))));
    this.#figures.replaceChildren(...figures(preview));
  }

  /** What is older than it may look is grey, and says since when. */
  #age() {
    const silent_s = (performance.now() - this.#lastMs) / 1000;
    const lost = silent_s > OLD_S ? ago(silent_s) : "";
    const { exposure, devices } = this.#last ?? NOTHING;
    this.#sign.show(this.#last ?? NOTHING, lost);
    this.#devices.show(devices, lost);
    const exposed_s = exposure ? exposure.age_s + silent_s : 0;
    const isOld = exposed_s > OLD_S;
    this.#canvas.classList.toggle("old", isOld);
    this.#figures.classList.toggle("old", isOld || lost !== "");
    if (isOld) this.#rate.textContent = t("preview.since", { since: ago(exposed_s) });
  }

  /** @param {Preview} preview */
  #measureRate({ version, exposure }) {
    if (!exposure || version === this.#version) return;
    this.#version = version;
    const nowMs = performance.now();
    this.#drawnMs = [...this.#drawnMs.filter((one) => nowMs - one < RATE_OVER_MS), nowMs];
    this.dataset["rate"] = String(this.#drawnMs.length);
    this.dataset["age"] = String(Math.round(1000 * exposure.age_s));
    this.#rate.textContent = t("preview.rate", { rate: this.#drawnMs.length, age: integer(Math.round(1000 * exposure.age_s)) });
  }
  #version = -1;
}

/** @param {Preview} preview */
function advice({ exposure, clocks }) {
  if (!exposure) return [];
  return [exposure.problem, exposure.weak, exposure.picture?.exposure_advice, exposure.picture?.focus_advice, clocks?.warning].flatMap((one) => (one ? [one] : []));
}

/** @param {Preview} preview */
function figures({ exposure, robot, table_deg, clocks }) {
  const rows = /** @type {[string, (Node | string)[]][]} */ ([]);
  if (exposure?.zone) rows.push([t("quality.zone"), [fixed(exposure.zone, 2), zoneBar(exposure.zone)]]);
  if (exposure?.extent_deg) rows.push([t("quality.extent"), [`${fixed(exposure.extent_deg, 0)}°`]]);
  if (exposure?.rms_mm) rows.push([t("preview.rms"), [small(exposure.rms_mm)]]);
  const picture = exposure?.picture;
  if (picture) {
    rows.push([t("preview.exposure"), [t("preview.brightness", { share: Math.round(100 * picture.brightness) })]]);
    if (picture.stripe_width_px) rows.push([t("preview.focus"), [`${fixed(picture.stripe_width_px, 1)} px`]]);
  }
  const place = robot?.base_from_tool0?.slice(0, 3).map((row) => fixed(row[3] ?? 0, 1));
  if (robot && place) rows.push([t("preview.robot"), [`${place.join("  ")} mm`, robot.age_s > OLD_S && ` · ${t("devices.since", { date: ago(robot.age_s) })}`].filter((part) => part !== false)]);
  if (table_deg !== null) rows.push([t("column.table"), [`${fixed(table_deg, 2)}°`]]);
  if (clocks) rows.push([t("preview.clocks"), [`${clocks.offset_s < 0 ? "" : "+"}${fixed(1000 * clocks.offset_s, 1)}\u00a0±\u00a0${fixed(2000 * clocks.sigma_s, 1)} ms`]]);
  return rows.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", { class: "number" }, ...value)));
}

customElements.define("sc-live-panel", LivePanelElement);

/** @param {SessionState} state */
export const livePanel = (state) => make(LivePanelElement, { state });
