// Solving a stage again with other settings: a form from the schema that the registry has of them.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { schemaForm } from "../components/schema-form.js";
import { attempt } from "../components/toasts.js";

/** @import {StageInfo} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/** @param {SessionState} state @param {StageInfo} stage one that has settings */
export function solveSettings(state, { name, settings, settings_field }) {
  const field = settings_field ?? "";
  const now = /** @type {Record<string, any>} */ (state.session?.cell ?? {})[field] ?? {};
  const again = (/** @type {Record<string, unknown>} */ chosen) => attempt(async () => {
    if (state.working) return;
    await api.changeSession(state.id, { cell: { [field]: chosen } });
    state.follows(await api.solve(state.id, name));
  });
  return h("details", { class: "panel" }, h("summary", {}, t("settings.title")), schemaForm(settings ?? {}, now, { prefix: field, go: t("settings.go"), submit: again }));
}
