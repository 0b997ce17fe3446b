// Saving an export; some ask something first: which tool of the controller, which frame, how fast.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { alarm, closeButton, openDialog, saveFile } from "../components/dialog.js";
import { schemaForm } from "../components/schema-form.js";
import { notify } from "../components/toasts.js";

/** @import {SessionAnswer} from "../state/model.js" */
/** @typedef {{ name: string, title: string, suffix: string, experimental: boolean, settings: import("../components/schema-form.js").Schema }} Entry of the registry */

/** It is fetched, not gone to: why there is nothing to save is told on this page. @param {string} sessionId @param {Entry} entry @param {Record<string, unknown>} chosen */
export async function saveExport(sessionId, { name, suffix }, chosen) {
  saveFile(await api.exported(sessionId, name, chosen), `${name}${suffix}`);
  notify(t("export.saved", { name: `${name}${suffix}` }));
}

/** Without the settings that say nothing of an answer: which scanner of one, a tool or frame that it has not. @param {import("../components/schema-form.js").Schema} schema @param {SessionAnswer} answer */
function settingsOf(schema, answer) {
  const seen = (answer.frames ?? []).filter(({ outof }) => outof === "laser"), names = seen.flatMap(({ scanner }) => scanner || []);
  const open = !answer.tool0_from_laser && !answer.base_from_laser && !seen.length; // the server says why nothing is written
  const rides = open || !!answer.tool0_from_laser || seen.some(({ into }) => into === "tool0"), stands = !!answer.base_from_laser || seen.some(({ into }) => into === "base"), table = open || !!answer.base_from_turntable;
  /** @type {Record<string, boolean>} */
  const has = { of_scanner: names.length > 1, tool: rides, flange: rides, scanner_frame: stands, frame: table, turntable: table, part: table };
  const kept = Object.entries(schema.properties ?? {}).filter(([name]) => has[name] ?? true);
  return { ...schema, properties: Object.fromEntries(kept.map(([name, one]) => [name, name === "of_scanner" ? { ...one, enum: names } : one])) };
}

/** @param {string} sessionId @param {Entry} entry */
export async function exportDialog(sessionId, entry) {
  const settings = settingsOf(entry.settings, await api.answer(sessionId));
  const { element: problem, during } = alarm();
  const save = async (/** @type {Record<string, unknown>} */ values) => {
    const chosen = Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null));
    if (await during(() => saveExport(sessionId, entry, chosen))) dialog.close();
  };
  const form = schemaForm(settings, {}, { prefix: "export", go: t("export.save"), submit: save, needs: "" });
  const dialog = openDialog("export", entry.title, [entry.experimental ? h("p", { class: "soft" }, t("export.by_manual")) : "", problem, form, h("div", { class: "row end" }, closeButton())]);
}
