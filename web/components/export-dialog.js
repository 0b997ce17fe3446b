// Saving an export; some ask something first: which tool of the controller, which frame, how fast.

import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { schemaForm } from "./schema-form.js";
import { notify } from "./toasts.js";

/** @typedef {{ name: string, title: string, suffix: string, settings: import("./schema-form.js").Schema }} Entry of the registry */

/** It is fetched, not gone to: why there is nothing to save is told on this page. @param {string} sessionId @param {Entry} entry @param {Record<string, unknown>} chosen */
export async function saveExport(sessionId, { name, suffix }, chosen) {
  const link = h("a", { href: URL.createObjectURL(await api.exported(sessionId, name, chosen)), download: `${name}${suffix}` });
  link.click();
  URL.revokeObjectURL(link.href);
  notify(t("export.saved", { name: link.download }));
}

/** @param {string} sessionId @param {Entry} entry */
export function exportDialog(sessionId, entry) {
  const alarm = h("p", { class: "form-problem", role: "alert", hidden: true });
  const dialog = h("dialog", { "aria-labelledby": "export-title" });
  const save = async (/** @type {Record<string, unknown>} */ values) => {
    alarm.hidden = true;
    const chosen = Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null));
    try {
      await saveExport(sessionId, entry, chosen);
      dialog.close();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      alarm.textContent = error.message;
      alarm.hidden = false;
    }
  };
  dialog.append(h("div", { class: "body" },
    h("h2", { id: "export-title" }, entry.title), alarm,
    schemaForm(entry.settings, {}, { prefix: "export", go: t("export.save"), submit: save, needs: "" }),
    h("div", { class: "row end" }, h("button", { type: "button", onclick: () => dialog.close() }, t("cancel")))));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
