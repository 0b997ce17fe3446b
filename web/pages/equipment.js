// The register of equipment, for all to look at; the administrator keeps it.

import "../texts/later.js";
import { RegisterElement } from "../equipment/register.js";
import { h, make } from "../dom.js";
import { t } from "../texts.js";

export class EquipmentPage extends HTMLElement {
  connectedCallback() {
    document.title = t("equipment.page_title");
    this.append(h("h1", {}, t("equipment.title")), h("p", { class: "soft" }, t("equipment.lead")), make(RegisterElement));
  }
}

customElements.define("sc-equipment", EquipmentPage);
