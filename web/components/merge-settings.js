// Merging again with another grid or mesh, with tool and table improved by the overlap, or with a fine registration.

import { api } from "../api.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { attempt } from "./toasts.js";

/** @import {SessionState} from "../state.js" */

const MESHES = /** @type {const} */ (["poisson", "grid", "none"]);

/** @param {SessionState} state */
export function mergeSettings(state) {
  const now = state.session?.cell.merge;
  const voxel = h("input", { id: "merge-voxel", inputmode: "decimal", autocomplete: "off", required: true, value: String(now?.voxel_mm ?? 0.5) });
  const mesh = h("select", { id: "merge-mesh" }, ...MESHES.map((kind) => h("option", { value: kind, selected: kind === (now?.mesh ?? "poisson") }, t(`merge.mesh_${kind}`))));
  const registration = choice("registration", now?.registration === true);
  const calibration = choice("self_calibration", now?.self_calibration === true);
  const again = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const size = Number(voxel.value.replace(",", "."));
    voxel.setCustomValidity(size > 0 ? "" : t("new.need_number"));
    if (!voxel.reportValidity() || state.working) return;
    const settings = { voxel_mm: size, mesh: mesh.value, registration: registration.input.checked, self_calibration: calibration.input.checked };
    await attempt(async () => {
      await api.changeSession(state.id, { cell: { merge: settings } });
      state.follows(await api.solve(state.id, "merge"));
      state.show("measure");
    });
  };
  voxel.addEventListener("input", () => voxel.setCustomValidity(""));
  return h(
    "details", {}, h("summary", {}, t("merge.settings")),
    h("form", { class: "merge-settings", novalidate: true, onsubmit: again },
      h("div", { class: "field" }, h("label", { for: "merge-voxel" }, t("merge.voxel_mm")), voxel),
      h("div", { class: "field" }, h("label", { for: "merge-mesh" }, t("merge.mesh")), mesh),
      calibration.field,
      registration.field,
      h("div", { class: "row end" }, h("button", { type: "submit", needs: "capture" }, t("merge.again")))),
  );
}

/** A box to tick, with what it does below. @param {"registration" | "self_calibration"} name @param {boolean} checked */
function choice(name, checked) {
  const id = `merge-${name.replace("_", "-")}`;
  const input = h("input", { type: "checkbox", id, checked, "aria-describedby": `${id}-hint` });
  const field = h("div", { class: "field" },
    h("div", { class: "row" }, input, h("label", { for: id }, t(`merge.${name}`))),
    h("span", { class: "hint", id: `${id}-hint` }, t(`merge.${name}_hint`)));
  return { input, field };
}
