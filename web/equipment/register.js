// The register of equipment: what sessions refer to, with certificates and when these are due.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { mark } from "../icons.js";
import { ROOT } from "../state/http.js";
import { t } from "../texts.js";
import { alarm, formButtons, closeButton, openDialog } from "../components/dialog.js";
import { attempt, notify } from "../components/toasts.js";
import { certificateButton, kindWords, pieceFields, pieceWords } from "./piece.js";

/** @import {RegisteredEquipment} from "../api-types.js" */

const HEADS = /** @type {const} */ (["equipment.kind", "equipment.name", "equipment.serial", "equipment.certificate", "equipment.due"]);

export class RegisterElement extends HTMLElement {
  #list = h("div", {});

  connectedCallback() {
    if (this.firstChild) return;
    this.append(
      h("div", { class: "row" }, h("button", { type: "button", class: "primary", needs: "admin", onclick: () => this.#edit() }, t("equipment.enter"))),
      h("section", { class: "panel", "aria-labelledby": "register-title" }, h("h2", { id: "register-title" }, t("equipment.register")), this.#list));
    void attempt(() => this.#load());
  }

  async #load() {
    const pieces = await api.equipment();
    if (!pieces.length) return this.#list.replaceChildren(h("p", { class: "soft" }, t("equipment.none")));
    this.#list.replaceChildren(h("table", { class: "compare" },
      h("thead", {}, h("tr", {}, ...HEADS.map((head) => h("th", { scope: "col" }, t(head))), h("td", {}))),
      h("tbody", {}, ...pieces.map((piece) => this.#row(piece)))));
  }

  /** @param {RegisteredEquipment} piece */
  #row(piece) {
    const { id, kind, name, model, serial, certificate, overdue, altered } = piece;
    const words = pieceWords(piece);
    const input = h("input", { type: "file", hidden: true, "aria-label": t("equipment.keep_certificate", { piece: words }), onchange: () => void this.#keep(id, input.files?.[0]) });
    const number = certificate?.number ?? certificate?.file;
    return h("tr", {},
      h("th", { scope: "row" }, kindWords(kind), altered ? mark("fail", t("equipment.altered")) : null), h("td", {}, [name, model].filter(Boolean).join(" · ")), h("td", {}, serial ?? ""),
      h("td", {}, certificate?.file ? h("a", { href: `${ROOT}/equipment/${encodeURIComponent(id)}/certificate`, download: certificate.file }, number ?? "") : number ?? "", certificate?.laboratory ? h("span", { class: "soft" }, ` ${certificate.laboratory}`) : null),
      h("td", { class: "number" }, certificate?.due ? (overdue ? mark("fail", t("equipment.overdue", { due: certificate.due })) : certificate.due) : ""),
      h("td", { class: "right" }, h("div", { class: "row" }, input,
        h("button", { type: "button", needs: "admin", "aria-label": t("equipment.keep_certificate", { piece: words }), onclick: () => input.click() }, t("equipment.certificate")),
        h("button", { type: "button", needs: "admin", "aria-label": t("equipment.correct", { piece: words }), onclick: () => this.#edit(piece) }, t("equipment.edit")),
        h("button", { type: "button", class: "danger", needs: "admin", "aria-label": t("equipment.remove", { name: words }), onclick: () => this.#askToRemove(piece) }, t("equipment.take_away")))));
  }

  /** @param {string} id @param {File | undefined} file */
  async #keep(id, file) {
    if (!file) return;
    await attempt(async () => {
      await api.keepCertificate(id, file);
      notify(t("equipment.certificate_kept", { name: file.name }));
      await this.#load();
    });
  }

  /** @param {RegisteredEquipment} [piece] a new one where none is given */
  #edit(piece) {
    const { element: problem, during } = alarm();
    const plain = piece && /** @type {import("../api-types.js").Equipment} */ (Object.fromEntries(Object.entries(piece).filter(([name]) => !["id", "created", "updated", "overdue", "altered"].includes(name))));
    const fields = pieceFields("piece", plain);
    const dialog = openDialog("piece", t(piece ? "equipment.edit" : "equipment.enter"), [certificateButton(fields.take), fields.element, problem, formButtons(t("place.save"))], { submit: async () => {
      const read = fields.read();
      if (!read || !await during(() => (piece ? api.changeEquipment(piece.id, read) : api.addEquipment(read)))) return;
      dialog.close();
      await attempt(() => this.#load());
    } });
  }

  /** @param {RegisteredEquipment} piece */
  #askToRemove(piece) {
    const remove = async () => {
      dialog.close();
      await attempt(async () => {
        await api.removeEquipment(piece.id);
        await this.#load();
      });
    };
    const dialog = openDialog("remove-piece", t("equipment.remove", { name: pieceWords(piece) }), [h("p", {}, t("equipment.remove_words")), h("div", { class: "row end" },
      closeButton(t("cancel"), { autofocus: true }), h("button", { type: "button", class: "danger", onclick: () => void remove() }, t("equipment.take_away")))]);
  }
}

customElements.define("sc-register", RegisterElement);
