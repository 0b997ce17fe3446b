// The calibrated tool put into a copy of the controller's backup: one entry changes, every other byte stays.

import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { h } from "../dom.js";
import { backupOf, remember } from "../state/backups.js";
import { chosen } from "../state/files.js";
import { offered } from "../state/registries.js";
import { learnTexts, t } from "../texts.js";
import { attempt, notify } from "./toasts.js";

await learnTexts("dialogs");

/** @import {Backup} from "../state/backups.js" */

/** @param {string} sessionId */
export function backupDialog(sessionId) {
  const alarm = h("p", { class: "form-problem", role: "alert", hidden: true });
  const files = h("input", { id: "backup-files", type: "file", multiple: true });
  const which = h("span", { class: "hint", id: "backup-which" });
  const format = h("select", { id: "backup-format" });
  const tool = h("select", { id: "backup-tool", required: true });
  const dialog = h("dialog", { "aria-labelledby": "backup-title" });

  const show = (/** @type {Backup} */ { found, content }) => {
    which.textContent = t("backup.holds", { files: found.map(({ path }) => path).slice(0, 3).join(", "), tools: content.tools.length });
    if ([...format.options].some(({ value }) => value === content.brand)) format.value = content.brand;
    const names = content.tools.map(({ number, name }) => ({ value: String(number ?? name), words: [number, name].filter((part) => part !== null && part !== "").join(" ") }));
    tool.replaceChildren(h("option", { value: "" }, t("backup.choose")), ...names.map(({ value, words }) => h("option", { value }, words)));
  };
  const read = async () => {
    const found = chosen(files);
    if (!found.length) return;
    await attempt(async () => {
      const content = await api.readControllerFiles(found);
      remember(sessionId, { found, content });
      show({ found, content });
    });
  };
  const save = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const backup = backupOf(sessionId);
    tool.setCustomValidity(tool.value ? "" : t("backup.need_tool"));
    if (!backup || !tool.reportValidity()) return;
    alarm.hidden = true;
    try {
      const { name, content } = await api.exportInto(sessionId, format.value, backup.found, { tool: tool.value });
      const link = h("a", { href: URL.createObjectURL(content), download: name });
      link.click();
      URL.revokeObjectURL(link.href);
      dialog.close();
      notify(t("backup.saved", { name, tool: tool.value }));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      alarm.textContent = error.message;
      alarm.hidden = false;
    }
  };
  files.addEventListener("change", () => void read());
  tool.addEventListener("change", () => tool.setCustomValidity(""));
  dialog.append(h(
    "form", { class: "body", novalidate: true, onsubmit: save },
    h("h2", { id: "backup-title" }, t("backup.title")),
    h("p", { class: "soft" }, t("backup.how")),
    h("div", { class: "field" }, h("label", { for: "backup-files" }, t("backup.files")), files, which),
    h("div", { class: "field" }, h("label", { for: "backup-format" }, t("backup.format")), format),
    h("div", { class: "field" }, h("label", { for: "backup-tool" }, t("backup.tool")), tool),
    alarm,
    h("div", { class: "row end" },
      h("button", { type: "button", onclick: () => dialog.close() }, t("cancel")),
      h("button", { type: "submit", class: "primary" }, t("backup.save")))));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
  void attempt(async () => {
    const patching = (await offered("exports")).filter(({ patches_a_backup: patches }) => patches);
    format.append(...patching.map(({ name, title }) => h("option", { value: name }, title)));
    const kept = backupOf(sessionId);
    if (kept) show(kept);
  });
}
