// Merging again with another grid, another mesh, or with a fine registration.

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
  const registration = h("input", { type: "checkbox", id: "merge-registration", checked: now?.registration === true, "aria-describedby": "merge-registration-hint" });
  const again = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const size = Number(voxel.value.replace(",", "."));
    voxel.setCustomValidity(size > 0 ? "" : t("new.need_number"));
    if (!voxel.reportValidity() || state.working) return;
    const settings = { voxel_mm: size, mesh: mesh.value, registration: registration.checked };
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
      h("div", { class: "field" }, h("div", { class: "row" }, registration, h("label", { for: "merge-registration" }, t("merge.registration"))), h("span", { class: "hint", id: "merge-registration-hint" }, t("merge.registration_hint"))),
      h("div", { class: "row end" }, h("button", { type: "submit", needs: "capture" }, t("merge.again")))),
  );
}
