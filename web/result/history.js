// The way to all results that a stage ever had, and what leads on from a result.

import { api } from "../state/api.js";
import { offered } from "../state/registries.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { attempt } from "../components/toasts.js";

/**
 * @param {string} sessionId
 * @param {string} stage
 */
export function historySection(sessionId, stage) {
  const list = h("div", { class: "history table-holder", tabindex: 0, role: "region", "aria-label": t("history.title") }, h("p", { class: "soft" }, t("history.wait")));
  const section = h("details", { class: "panel" }, h("summary", {}, t("history.title")), list);
  section.addEventListener("toggle", () => {
    if (section.open) void attempt(async () => list.replaceChildren((await import("./past-results.js")).pastResults(await api.history(sessionId, stage), sessionId, stage)));
  });
  return section;
}

/** What leads on from a result: the report to print, the review, another session beside it. @param {string} sessionId @param {string} stage */
export function resultLinks(sessionId, stage) {
  const id = encodeURIComponent(sessionId);
  return h("nav", { class: "result-links row", "aria-label": t("result.links") },
    h("a", { class: "button", href: api.reportAddress(sessionId), target: "_blank", rel: "noopener" }, t("result.report")),
    h("a", { class: "button", href: api.pdfAddress(sessionId), target: "_blank", rel: "noopener" }, t("result.pdf")),
    h("a", { class: "button", href: `/sessions/${id}/review` }, t("result.review")),
    h("a", { class: "button", href: `/compare?${new URLSearchParams({ stage, left: sessionId })}` }, t("result.compare")),
    h("a", { class: "button", href: api.archiveAddress(sessionId), download: "" }, t("review.archive")), exportMenu(sessionId),
    h("button", { type: "button", onclick: async () => (await import("../guidance/budget-dialog.js")).budgetDialog(sessionId) }, t("result.budget")),
    h("button", { type: "button", onclick: async () => (await import("../guidance/planned-dialog.js")).plannedDialog(sessionId) }, t("result.planned")),
    h("button", { type: "button", onclick: async () => (await import("./backup-dialog.js")).backupDialog(sessionId) }, t("backup.open")),
    h("button", { type: "button", onclick: async () => (await import("./read-back-dialog.js")).readBackDialog(sessionId) }, t("read_back.open")));
}

/** The answer in another program's syntax: one entry for each export that the server has; some ask something first. @param {string} sessionId */
function exportMenu(sessionId) {
  /** @type {any[]} */ let entries = [];
  const list = h("select", { class: "export-menu", "aria-label": t("result.export"), onchange: async () => {
    const entry = entries.find(({ name }) => name === list.value);
    list.value = "";
    if (!entry) return;
    const { exportDialog, saveExport } = await import("./export-dialog.js");
    await attempt(() => (Object.keys(entry.settings.properties ?? {}).length ? exportDialog(sessionId, entry) : saveExport(sessionId, entry, {})));
  } }, h("option", { value: "" }, t("result.export")));
  void attempt(async () => {
    entries = await offered("exports");
    const options = (/** @type {boolean} */ experimental) => entries.filter((entry) => entry.experimental === experimental).map(({ name, title }) => h("option", { value: name }, title));
    list.append(...options(false), h("optgroup", { label: t("export.experimental") }, ...options(true)));
  });
  return list;
}
