// The table turned from here: armed with limits for some minutes, an angle to go to, and a stop that is always in reach.

import "../texts/later.js";
import { live } from "../state/live.js";
import { schemaForm } from "../components/schema-form.js";
import { attempt } from "../components/toasts.js";
import { field, h } from "../dom.js";
import { fixed, typedNumber } from "../format.js";
import { t } from "../texts.js";

/** @import {TableMover} from "../api-types.js" */

const LOOK_MS = 2000;
const STOP_MS = 500;

export class TableElement extends HTMLElement {
  sessionId = "";
  #timer = 0;
  #stopping = Promise.resolve();
  #told = "";
  #form = h("div", { hidden: true });
  #angle = h("input", { inputmode: "decimal", autocomplete: "off" });
  #state = h("p", { class: "soft small", role: "status" });
  #arm = h("button", { type: "button", needs: "admin", onclick: () => void this.#offer() }, t("table.arm"));
  #go = h("button", { type: "button", class: "primary", needs: "capture", onclick: () => void this.#turn() }, t("table.go"));
  #stop = h("button", { type: "button", class: "danger", needs: "capture", onclick: () => { this.#stopping = this.#do(() => live.stopTable(this.sessionId)); } }, t("table.stop"));
  #disarm = h("button", { type: "button", needs: "capture", onclick: () => void this.#off() }, t("table.disarm"));
  #armed = h("div", { class: "row live-capture", hidden: true },
    field("table-target", t("table.target"), this.#angle), this.#go, this.#stop, this.#disarm);

  /** Whether the table may turn: its stop stays in reach even where its angle is lost. */
  get isArmed() {
    return !this.#armed.hidden;
  }

  connectedCallback() {
    if (!this.firstChild) this.append(h("div", { class: "row live-capture" }, this.#arm, this.#state), this.#form, this.#armed);
    void this.#load();
    this.#timer = window.setInterval(() => void this.#load(), LOOK_MS);
  }

  disconnectedCallback() {
    window.clearInterval(this.#timer);
  }

  async #load() {
    if (this.hidden) return;
    const mover = await live.mover(this.sessionId).catch(() => null);
    if (mover) this.#show(mover);
  }

  /** @param {TableMover} mover */
  #show({ armed, low_deg, high_deg, seconds_left }) {
    const minutes = Math.ceil(seconds_left / 60);
    const told = armed ? t("table.armed", { low: fixed(low_deg ?? 0, 1), high: fixed(high_deg ?? 0, 1), minutes }) : t("table.off");
    if (told === this.#told) return;
    this.#told = told;
    this.#state.textContent = told;
    this.#armed.hidden = !armed;
    this.#arm.hidden = armed;
    if (armed) this.#form.hidden = true;
  }

  async #offer() {
    await attempt(async () => {
      const [mover] = await live.movers();
      if (!mover) return;
      const limits = { low_deg: { type: "number" }, high_deg: { type: "number" }, minutes: { type: "number", default: 15 } };
      const given = /** @type {{ properties?: Record<string, object> }} */ (mover.settings).properties ?? {};
      this.#form.replaceChildren(h("p", { class: "reason" }, t("table.warning")), schemaForm({ properties: { ...limits, ...given } }, {}, {
        prefix: "device", ids: "mover", go: t("table.arm"), needs: "admin", submit: async ({ low_deg, high_deg, minutes, ...settings }) => {
          const kept = Object.fromEntries(Object.entries(settings).filter(([, value]) => value !== null));
          await attempt(async () => this.#show(await live.arm(this.sessionId, { mover: mover.name, settings: kept, low_deg, high_deg, minutes })));
        } }));
      this.#form.hidden = false;
    });
  }

  async #turn() {
    const angle = typedNumber(this.#angle.value);
    const given = Number.isFinite(angle); // an empty field is no 0: nothing moves
    this.#angle.setCustomValidity(given ? "" : t("form.need_number"));
    if (!this.#angle.reportValidity()) return;
    this.#go.setAttribute("aria-disabled", "true");
    await this.#do(() => live.turn(this.sessionId, angle));
    this.#go.removeAttribute("aria-disabled");
  }

  /** Behind a stop that is on its way, which a disarmed table would refuse; it stops the table itself, so it waits for no slow one. */
  async #off() {
    await Promise.race([this.#stopping, new Promise((go) => setTimeout(go, STOP_MS))]);
    await this.#do(() => live.disarmTable(this.sessionId));
  }

  /** @param {() => Promise<unknown>} act */
  async #do(act) {
    await attempt(act);
    await this.#load();
  }
}

customElements.define("sc-live-table", TableElement);
