// Where the table stood in one capture: its angle, and the name of the sphere's mounting.

import "../texts/later.js";
import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { inField, typedNumber } from "../format.js";
import { t } from "../texts.js";
import { did } from "../state/undo.js";
import { formButtons, openDialog } from "../components/dialog.js";
import { withReason } from "./exclude.js";

/** @import {CaptureOut} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/**
 * @param {SessionState} state
 * @param {CaptureOut} capture
 */
export function tableDialog(state, capture) {
  const angle = h("input", { inputmode: "decimal", autocomplete: "off", required: true, autofocus: true, value: inField(capture.table_deg), oninput: () => angle.setCustomValidity("") });
  const mount = h("input", { id: "place-mount", autocomplete: "off", value: capture.mount ?? "", "aria-describedby": "place-hint" });
  const save = async () => {
    const value = typedNumber(angle.value);
    angle.setCustomValidity(Number.isFinite(value) ? "" : t("place.need_angle"));
    if (!angle.reportValidity()) return;
    const change = { table_deg: value, mount: mount.value.trim() || null };
    const before = { table_deg: capture.table_deg ?? null, mount: capture.mount ?? null };
    const act = async (/** @type {string} */ why) => {
      await api.changeCapture(state.id, capture.id, { ...change, ...(why ? { changed_because: { why } } : {}) });
      dialog.close();
      did(t("place.changed", { capture: capture.id }), () => api.changeCapture(state.id, capture.id, before));
    };
    await withReason(state, { title: t("captures.change_decided"), go: t("place.save"), act });
  };
  const dialog = openDialog("place", t("place.title", { capture: capture.id }), [
    field("place-angle", t("place.angle"), angle),
    h("div", { class: "field" }, h("label", { for: "place-mount" }, t("place.mount")), h("span", { class: "hint", id: "place-hint" }, t("place.mount_hint")), mount),
    formButtons(t("place.save")),
  ], { submit: save });
}
