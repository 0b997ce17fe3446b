// The robot's arm, by its name or from its URDF: the scene draws it, and joints are held against poses.

import "../texts/later.js";
import { json, request } from "../state/http.js";
import { h } from "../dom.js";
import { t } from "../texts.js";
import { attempt } from "../components/toasts.js";

const URDF = "urdf";

/** @typedef {import("../api-types.js").ArmTable} ArmTable */

/** Put a list of arms in a button's place. @param {HTMLButtonElement} button */
export function chooseArm(button) {
  return attempt(async () => {
    const held = button.form?.elements.namedItem("arm");
    if (!(held instanceof HTMLInputElement)) return;
    /** @type {{ items: string[] }} */
    const { items } = await (await request("/arms")).json();
    const file = h("input", { type: "file", accept: ".urdf,.xacro,.xml,.yaml,.yml", hidden: true });
    const select = h("select", { id: button.id }, h("option", { value: "" }, t("arm.unknown")),
      ...items.map((name) => h("option", { value: JSON.stringify(name) }, name)), h("option", { value: URDF }, t("arm.urdf")));
    const show = () => {
      if (held.value && ![...select.options].some(({ value }) => value === held.value)) select.append(h("option", { value: held.value }, wordsOf(held.value)));
      select.value = held.value;
    };
    select.addEventListener("change", () => {
      if (select.value === URDF) file.click();
      else held.value = select.value;
    });
    file.addEventListener("cancel", show);
    file.addEventListener("change", () => void attempt(async () => {
      const [one] = file.files ?? [];
      try {
        if (one) held.value = JSON.stringify(await (await request("/arms", json("POST", { xml: await one.text(), name: one.name }))).json());
      } finally {
        file.value = "";
        show();
      }
    }));
    show();
    button.replaceWith(h("div", { class: "field" }, h("label", { for: select.id }, t("plan.arm")), select, file));
    select.focus();
  });
}

/** @param {string} held */
function wordsOf(held) {
  /** @type {string | ArmTable} */
  const arm = JSON.parse(held);
  return typeof arm === "string" ? arm : t("arm.taken", { source: arm.source ?? "Denavit–Hartenberg", count: arm.joints.length });
}
