// An export that asks something first: which tool of the controller, which frame, how fast. Then it is saved.

import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { schemaForm } from "./schema-form.js";
import { notify } from "./toasts.js";

/** @param {string} sessionId @param {{ name: string, title: string, suffix: string, settings: import("./schema-form.js").Schema }} entry of the registry */
export function exportDialog(sessionId, { name, title, suffix, settings }) {
  const alarm = h("p", { class: "form-problem", role: "alert", hidden: true });
  const dialog = h("dialog", { "aria-labelledby": "export-title" });
  const save = async (/** @type {Record<string, unknown>} */ values) => {
    alarm.hidden = true;
    const chosen = Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null));
    try {
      const link = h("a", { href: URL.createObjectURL(await api.exported(sessionId, name, chosen)), download: `${name}${suffix}` });
      link.click();
      URL.revokeObjectURL(link.href);
      dialog.close();
      notify(t("export.saved", { name: link.download }));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      alarm.textContent = error.message;
      alarm.hidden = false;
    }
  };
  dialog.append(h("div", { class: "body" },
    h("h2", { id: "export-title" }, title), alarm,
    schemaForm(settings, {}, { prefix: "export", go: t("export.save"), submit: save, needs: "" }),
    h("div", { class: "row end" }, h("button", { type: "button", onclick: () => dialog.close() }, t("cancel")))));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
