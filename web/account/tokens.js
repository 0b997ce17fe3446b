// Tokens: made here, shown once, listed and revoked.

import "../texts/later.js";
import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { when } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { copyButton } from "../components/copy.js";
import { closeButton, openDialog } from "../components/dialog.js";
import { attempt, notify } from "../components/toasts.js";

/** @import {TokenRecord} from "../state/model.js" */

const ROLES = /** @type {const} */ (["read", "capture", "release", "admin"]);
const HEADS = /** @type {const} */ (["name", "tokens.role", "tokens.created", "tokens.expires", "column.state"]);

export class TokensElement extends HTMLElement {
  /** Called after each change, so that the log follows. */ changed = () => {};
  #name = h("input", { required: true, maxlength: 200, autocomplete: "off", oninput: () => this.#name.setCustomValidity("") });
  #role = h("select", {}, ...ROLES.map((role) => h("option", { value: role }, t(`role.${role}`))));
  #days = h("input", { inputmode: "decimal", autocomplete: "off", oninput: () => this.#days.setCustomValidity("") });
  #made = h("div", { role: "status" });
  #list = h("div", {});

  connectedCallback() {
    if (this.firstChild) return;
    this.append(this.#form(), h("section", { class: "panel", "aria-labelledby": "tokens-title" }, h("h2", { id: "tokens-title" }, t("tokens.title")), this.#list));
    void attempt(() => this.#load());
  }

  #form() {
    return h("section", { class: "panel", "aria-labelledby": "make-title" },
      h("h2", { id: "make-title" }, t("tokens.make")),
      h("form", { class: "token-form", novalidate: true, onsubmit: (/** @type {Event} */ event) => void this.#make(event) },
        field("token-name", t("name"), this.#name, t("tokens.name_hint")),
        field("token-role", t("tokens.role"), this.#role),
        field("token-days", t("tokens.days"), this.#days, t("tokens.days_hint")),
        h("button", { type: "submit", class: "primary" }, t("tokens.go"))),
      this.#made);
  }

  async #load() {
    const tokens = await api.tokens();
    if (!tokens.length) return this.#list.replaceChildren(h("p", { class: "soft" }, t("tokens.none")));
    this.#list.replaceChildren(h("table", { class: "compare" },
      h("thead", {}, h("tr", {}, ...HEADS.map((head) => h("th", { scope: "col" }, t(head))), h("td", {}))),
      h("tbody", {}, ...tokens.map((token) => this.#row(token)))));
  }

  /** @param {TokenRecord} token */
  #row(token) {
    const { name, role, created, expires, revoked } = token;
    const state = revoked ? "revoked" : expires && new Date(expires) < new Date() ? "expired" : "good";
    return h("tr", {},
      h("th", { scope: "row" }, name), h("td", {}, role), h("td", { class: "number" }, when(created)), h("td", { class: "number" }, expires ? when(expires) : t("tokens.forever")),
      h("td", {}, mark(state === "good" ? "pass" : "skipped", t(`tokens.${state}`))),
      h("td", { class: "right" }, state === "good" && h("button", { type: "button", class: "danger", "aria-label": t("tokens.end_what", { name }), onclick: () => this.#askToRevoke(token) }, t("tokens.end"))));
  }

  /** @param {Event} event */
  async #make(event) {
    event.preventDefault();
    const name = this.#name.value.trim();
    const typed = this.#days.value.trim().replace(",", ".");
    this.#name.setCustomValidity(name ? "" : t("tokens.need_name"));
    this.#days.setCustomValidity(typed === "" || Number(typed) > 0 ? "" : t("tokens.need_days"));
    if (!this.#name.reportValidity() || !this.#days.reportValidity()) return;
    await attempt(async () => {
      const made = await api.makeToken({ name, role: ROLES.find((role) => role === this.#role.value) ?? "read", ...(typed ? { days: Number(typed) } : {}) });
      const token = made.token ?? "";
      this.#made.replaceChildren(h("div", { class: "made-token" },
        h("h3", {}, t("tokens.made", { name })), h("div", { class: "copy-row" }, h("code", {}, token), copyButton(token, t("tokens.copy"))), h("p", { class: "soft small" }, t("tokens.once"))));
      this.#name.value = this.#days.value = "";
      await this.#load();
      this.changed();
    });
  }

  /** @param {TokenRecord} token */
  #askToRevoke({ id, name }) {
    const revoke = async () => {
      dialog.close();
      if (!await attempt(() => api.revokeToken(id))) return;
      notify(t("tokens.ended", { name }));
      await attempt(() => this.#load());
      this.changed();
    };
    const dialog = openDialog("revoke", t("tokens.end_what", { name }), [h("p", {}, t("tokens.end_words")), h("div", { class: "row end" },
      closeButton(t("cancel"), { autofocus: true }), h("button", { type: "button", class: "danger", onclick: () => void revoke() }, t("tokens.end")))]);
  }
}

customElements.define("sc-tokens", TokensElement);
