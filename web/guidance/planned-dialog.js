// A planned set for the next captures, and the same as a program for the robot's controller.

import { get, request } from "../state/http.js";
import { registry, stages } from "../state/registries.js";
import { h } from "../dom.js";
import { fixed, forController, plusMinus } from "../format.js";
import { maybe, t } from "../texts.js";
import { attempt, notify } from "../components/toasts.js";
import { alarm, saveFile } from "../components/dialog.js";
import { axesWords, choice, numberField, opened, tableOf } from "./parts.js";

/** @import {PoseList} from "../api-types.js" */

/** @param {string} sessionId */
export async function plannedDialog(sessionId) {
  const steps = (await stages()).flatMap(({ planned, step }) => (planned && step ? [step] : []));
  const { element: problem, during } = alarm();
  const step = choice("planned-step", t("planned.step"), steps.map(({ name, title }) => [name, maybe(`planned.step_${name}`, title)]));
  const count = numberField("planned-count", t("plan.captures"), 8);
  const brand = choice("planned-brand", t("planned.brand"), []);
  const list = h("div", { class: "planned-list", "aria-live": "polite" });
  const base = `/sessions/${encodeURIComponent(sessionId)}/planned`;
  const asked = (/** @type {Record<string, string>} */ more) => new URLSearchParams({ captures: String(count.read() ?? 8), step: step.select.value, ...more });

  const show = (/** @type {Event} */ event) => {
    event.preventDefault();
    if (count.read() === undefined) return;
    list.replaceChildren(h("p", { class: "soft" }, t("plan.wait")));
    void during(async () => list.replaceChildren(...listed(await get(`${base}?${asked({})}`)))).then(() => { if (!problem.hidden) list.replaceChildren(); });
  };
  const save = () => during(async () => {
    const response = await request(`${base}/program?${asked({ brand: brand.select.value })}`);
    const name = /filename="([^"]+)"/.exec(response.headers.get("content-disposition") ?? "")?.[1] ?? "planned.txt";
    saveFile(await response.blob(), name);
    notify(t("planned.saved", { name }));
  });
  opened("planned", t("planned.title"), h("p", { class: "soft" }, t("planned.how")),
    h("form", { class: "fields", novalidate: true, onsubmit: show }, step.element, count.element, h("button", { type: "submit" }, t("plan.go"))),
    problem, list,
    h("div", { class: "fields" }, brand.element, h("button", { type: "button", onclick: () => void save() }, t("planned.save"))),
    h("p", { class: "soft" }, t("planned.safety")));
  void attempt(async () => {
    const checks = (await registry("exports")).filter(({ name }) => name.endsWith("-check-move"));
    const options = (/** @type {boolean} */ experimental) => checks.filter((entry) => entry.experimental === experimental)
      .map(({ brand: value, title }) => h("option", { value: value ?? "" }, title.split(":")[0] ?? title));
    brand.select.append(...options(false), h("optgroup", { label: t("export.experimental") }, ...options(true)));
  });
}

/** @param {PoseList} plan @returns {HTMLElement[]} */
function listed(plan) {
  const rows = plan.poses.map((pose, index) => [
    String(index + 1), pose.numbers.map((one) => forController(one, 3)).join(" "),
    axesOf(pose),
    pose.uncertainty_mm === null ? "–" : plusMinus(pose.uncertainty_mm, "mm"),
  ]);
  return [h("p", {}, plan.note), tableOf(["#", t("planned.pose", { convention: plan.pose_convention }), t("column.table"), t("plan.then")], rows, t("planned.title"))];
}

/**
 * @param {PoseList["poses"][number]} pose
 * @returns {string} where table and axes are to stand, and whose capture of which sphere it is
 */
function axesOf(pose) {
  const table = [pose.table_deg == null ? "" : `${fixed(pose.table_deg, 1)}°`, pose.higher_mm ? `${fixed(pose.higher_mm, 0)} mm` : ""];
  return [...table, axesWords(pose), pose.scanner ?? "", pose.mount ?? ""].filter(Boolean).join(", ") || "–";
}
