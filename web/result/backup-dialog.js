// The calibrated tool put into a copy of the controller's backup: one entry changes, every other byte stays.

import "../texts/later.js";
import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { backupOf, remember } from "../state/backups.js";
import { chosen } from "../state/files.js";
import { offered } from "../state/registries.js";
import { t } from "../texts.js";
import { alarm, formButtons, openDialog, saveFile } from "../components/dialog.js";
import { attempt, notify } from "../components/toasts.js";

/** @import {Backup} from "../state/backups.js" */

/** @param {string} sessionId */
export function backupDialog(sessionId) {
  const { element: problem, during } = alarm();
  const files = h("input", { id: "backup-files", type: "file", multiple: true, onchange: () => void read() });
  const which = h("span", { class: "hint", id: "backup-which" });
  const format = h("select", {});
  const tool = h("select", { required: true, onchange: () => tool.setCustomValidity("") });

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
  const save = async () => {
    const backup = backupOf(sessionId);
    tool.setCustomValidity(tool.value ? "" : t("backup.need_tool"));
    if (!backup || !tool.reportValidity()) return;
    await during(async () => {
      const { name, content } = await api.exportInto(sessionId, format.value, backup.found, { tool: tool.value });
      saveFile(content, name);
      dialog.close();
      notify(t("backup.saved", { name, tool: tool.value }));
    });
  };
  const dialog = openDialog("backup", t("backup.title"), [
    h("p", { class: "soft" }, t("backup.how")),
    h("div", { class: "field" }, h("label", { for: "backup-files" }, t("backup.files")), files, which),
    field("backup-format", t("backup.format"), format), field("backup-tool", t("backup.tool"), tool),
    problem, formButtons(t("backup.save")),
  ], { submit: save });
  void attempt(async () => {
    const patching = (await offered("exports")).filter(({ patches_a_backup: patches }) => patches);
    format.append(...patching.map(({ name, title }) => h("option", { value: name }, title)));
    const kept = backupOf(sessionId);
    if (kept) show(kept);
  });
}
