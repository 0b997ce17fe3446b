// A sphere's digital certificate read into the form of a new cell: its diameter and its standard uncertainty.

import "../texts/later.js";
import { json, request } from "../state/http.js";
import { h } from "../dom.js";
import { inField } from "../format.js";
import { t } from "../texts.js";
import { attempt, notify } from "../components/toasts.js";

/** @param {HTMLFormElement | null} form */
export function fillFromCertificate(form) {
  const input = h("input", { type: "file", accept: ".xml,.dcc" });
  input.addEventListener("change", () => void attempt(async () => {
    const file = input.files?.[0];
    if (!file || !form) return;
    /** @type {import("../api-types.js").Certificate} */
    const found = await (await request("/certificates", json("POST", { xml: await file.text() }))).json();
    const one = found.diameters[0];
    if (!one) return;
    const put = (/** @type {string} */ name, /** @type {number | null} */ value) => {
      const field = form.elements.namedItem(name);
      if (field instanceof HTMLInputElement) field.value = String(inField(value));
    };
    put("diameter", one.diameter_mm);
    put("diameter_sigma", one.sigma_mm);
    const kept = form.elements.namedItem("sphere");
    if (kept instanceof HTMLInputElement) kept.value = JSON.stringify(found.equipment);
    notify(t(found.diameters.length > 1 ? "certificate.several" : "certificate.taken", { name: one.name, number: found.identifier }));
  }));
  input.click();
}
