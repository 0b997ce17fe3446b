// Saving an export; some ask something first: which tool of the controller, which frame, how fast.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { alarm, closeButton, openDialog, saveFile } from "../components/dialog.js";
import { schemaForm } from "../components/schema-form.js";
import { notify } from "../components/toasts.js";

/** @typedef {{ name: string, title: string, suffix: string, experimental: boolean, settings: import("../components/schema-form.js").Schema }} Entry of the registry */

/** It is fetched, not gone to: why there is nothing to save is told on this page. @param {string} sessionId @param {Entry} entry @param {Record<string, unknown>} chosen */
export async function saveExport(sessionId, { name, suffix }, chosen) {
  saveFile(await api.exported(sessionId, name, chosen), `${name}${suffix}`);
  notify(t("export.saved", { name: `${name}${suffix}` }));
}

/** @param {string} sessionId @param {Entry} entry */
export function exportDialog(sessionId, entry) {
  const { element: problem, during } = alarm();
  const save = async (/** @type {Record<string, unknown>} */ values) => {
    const chosen = Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null));
    if (await during(() => saveExport(sessionId, entry, chosen))) dialog.close();
  };
  const form = schemaForm(entry.settings, {}, { prefix: "export", go: t("export.save"), submit: save, needs: "" });
  const dialog = openDialog("export", entry.title, [entry.experimental ? h("p", { class: "soft" }, t("export.by_manual")) : "", problem, form, h("div", { class: "row end" }, closeButton())]);
}
