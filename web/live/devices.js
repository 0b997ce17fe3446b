// The devices of the cell with their state, and the form that adds one.

import "../texts/later.js";
import { ago, live, OLD_S } from "../state/live.js";
import { offered } from "../state/registries.js";
import { schemaForm } from "../components/schema-form.js";
import { attempt } from "../components/toasts.js";
import { field, h, keyed, putChildren } from "../dom.js";
import { icon, mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";

/** @import {DeviceEntry} from "../api-types.js" */
/** @import {LiveDevice} from "../state/live.js" */

const SIGNS = /** @type {Readonly<Record<string, string>>} */ ({ live: "pass", connecting: "working", silent: "warn", nonsense: "warn", lost: "fail", stale: "fail", off: "todo" });

export class DevicesElement extends HTMLElement {
  sessionId = "";
  /** @type {DeviceEntry[]} */ #items = [];
  #list = h("ul", { class: "live-devices" });
  #none = h("p", { class: "soft" }, t("devices.none"));
  #form = h("div", { hidden: true });

  connectedCallback() {
    if (!this.firstChild) this.append(this.#none, this.#list, this.#form);
    void this.load();
  }

  get items() {
    return this.#items;
  }

  async load() {
    await attempt(async () => { this.#items = (await live.devices(this.sessionId)).items; });
    this.show([]);
  }

  /** What is kept with the cell, and how it stands now, or stood when the server last spoke. @param {LiveDevice[]} now @param {string} [lost] since when it does not */
  show(now, lost = "") {
    if (now.some(({ name }) => !this.#items.some((one) => one.name === name))) void this.load();
    this.#none.hidden = this.#items.length > 0;
    keyed(this.#list, this.#items, ({ name }) => name, () => h("li", {}), (row, item) => {
      const state = now.find(({ name }) => name === item.name) ?? item;
      const { status: link, problem, rate_hz, fresh } = state;
      const status = link === "live" && !fresh ? "stale" : link;
      const since = lost || ("age_s" in state && state.age_s > OLD_S ? ago(state.age_s) : "");
      const told = `${status} ${problem} ${rate_hz} ${item.connected_for} ${since}`;
      if (row instanceof HTMLElement && row.dataset["told"] !== told) {
        row.dataset["told"] = told;
        row.dataset["status"] = status;
        row.classList.toggle("old", since !== "");
        putChildren(row, this.#row(item, status, problem, since ? t("devices.since", { date: since }) : status === "live" ? `${Math.round(rate_hz)}/s` : ""));
      }
    });
  }

  /** @param {DeviceEntry} item @param {string} status @param {string} problem @param {string} heard */
  #row(item, status, problem, heard) {
    const connected = item.connected_for === this.sessionId;
    const word = maybe(`device.${status}`, status);
    return [
      h("div", { class: "row spread" },
        h("p", {}, h("strong", {}, item.name), " ", mark(SIGNS[status] ?? "todo", word), h("span", { class: "soft small" }, ` ${item.title}${heard && ` · ${heard}`}`)),
        h("span", { class: "row" },
          h("button", { type: "button", class: "small", needs: "admin", onclick: () => void this.#put(item, !connected) }, t(connected ? "devices.disconnect" : "devices.connect")),
          h("button", { type: "button", class: "plain icon", needs: "admin", "aria-label": t("devices.remove", { name: item.name }), onclick: () => void this.#remove(item) }, icon("trash")))),
      problem ? h("p", { class: status === "lost" ? "reason reason-fail" : "reason" }, said(problem)) : "",
    ];
  }

  /** @param {DeviceEntry} item @param {boolean} connected */
  async #put({ name, source, settings }, connected) {
    await attempt(async () => { this.#items = (await live.put(this.sessionId, name, { source, settings, connected })).items; });
    this.show([]);
  }

  /** @param {DeviceEntry} item */
  async #remove({ name }) {
    await attempt(() => live.remove(this.sessionId, name));
    await this.load();
  }

  /** Offer the live sources that this server has. */
  async add() {
    const sources = (await offered("sources")).filter(({ delivers }) => delivers?.length);
    const name = h("input", { value: "", autocomplete: "off" });
    const place = h("div", {});
    const pick = () => {
      const source = sources.find((one) => one.name === select.value);
      name.value = source?.delivers[0] ?? "";
      place.replaceChildren(schemaForm(source?.settings ?? {}, {}, { prefix: "device", go: t("devices.connect"), submit: async (values) => {
        const settings = Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null));
        const went = await attempt(async () => { this.#items = (await live.put(this.sessionId, name.value.trim(), { source: select.value, settings, connected: true })).items; });
        this.#form.hidden = went;
        this.show([]);
      } }));
    };
    const select = h("select", { onchange: pick }, ...sources.map((one) => h("option", { value: one.name }, one.title)));
    this.#form.replaceChildren(
      field("device-source", t("devices.source"), select),
      field("device-name", t("name"), name), place);
    pick();
    this.#form.hidden = false;
    select.focus();
  }
}

customElements.define("sc-devices", DevicesElement);
