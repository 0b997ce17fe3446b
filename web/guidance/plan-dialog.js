// What a cell will reach before anything is bought or mounted: scanner, arm, sphere and edges in; ±, captures and places out. Any such cell can be tried, simulated.

import { api } from "../state/api.js";
import { json, request } from "../state/http.js";
import { h, make } from "../dom.js";
import { ChainPictureElement, turntableBox } from "../measure/chain-picture.js";
import { go } from "../router.js";
import { fixed, plusMinus } from "../format.js";
import { said, t } from "../texts.js";
import { alarm } from "../components/dialog.js";
import { axesWords, choice, numberField, opened, tableOf } from "./parts.js";

/** @import {CellPlan, EdgesPlan} from "../api-types.js" */

/** `[name in the request, what an ordinary one has]`; lengths in mm. */
const FIELD = /** @type {const} */ ([["near_mm", 130], ["far_mm", 230], ["near_width_mm", 60], ["far_width_mm", null]]);
const SCANNER = /** @type {const} */ ([["point_sigma_mm", 0.02], ["pitch_mm", 0.1], ["mounting_mm", 150]]);
const WANTED = /** @type {const} */ ([["sphere_diameter_mm", null], ["wanted_mm", 0.2]]);
const TABLE = /** @type {const} */ ([["radius_mm", 100], ["height_mm", 150], ["angle_sigma_deg", 0.005]]);
const ARMS = /** @type {const} */ (["ordinary", "calibrated", "nominal"]);
const SPHERES = /** @type {const} */ (["certified", "bearing", "coated", "turned"]);
const MACHINES = /** @type {const} */ (["arm", "scara", "gantry", "linear"]);
const TURNTABLE = { name: "table", kind: "rotary" };
const SEEDS = 10000, SCANS = 6;

export function planDialog() {
  const { element: problem, during } = alarm();
  /** @param {readonly (readonly [string, number | null])[]} group @param {string} [of] */
  const fields = (group, of = "") => group.map(([name, usual]) => ({ name, ...numberField(`plan-${of}${name.replaceAll("_", "-")}`, t(/** @type {any} */ (`plan.${of}${name}`)), usual) }));
  const [field, scanner, wanted, part] = [fields(FIELD), fields(SCANNER), fields(WANTED), fields(TABLE, "table_")];
  const arm = choice("plan-arm", t("plan.arm"), ARMS.map((one) => [one, t(`plan.arm_${one}`)]));
  const sphere = choice("plan-sphere", t("plan.sphere_class"), SPHERES.map((one) => [one, t(`plan.sphere_${one}`)]));
  const ofTable = h("div", { class: "fields", hidden: true }, ...part.map(({ element }) => element));
  const machine = choice("plan-machine", t("plan.machine"), MACHINES.map((one) => [one, t(`plan.machine_${one}`)]));
  const chain = make(ChainPictureElement, { cell: {} });
  const { element: tableRow, input: table } = turntableBox(chain, "plan-table", t("plan.table"), (there) => { ofTable.hidden = !there; });
  /** The cell by its edges, the turntable as one of its axes. */
  const edges = () => {
    const { axes = [], sphere_distances: _, ...told } = chain.value;
    const all = table.checked && !axes?.some(({ name }) => name === TURNTABLE.name) ? [...(axes ?? []), TURNTABLE] : axes ?? [];
    return { ...told, ...(all.length && { axes: all }), ...(machine.select.value !== "arm" && { machine: machine.select.value }) };
  };
  const readAll = () => {
    const read = [field, scanner, wanted, table.checked ? part : []].map((group) => group.map(({ name, read: one }) => /** @type {const} */ ([name, one()])));
    return read.flat().some(([, value]) => value === undefined) ? null : read.map((group) => Object.fromEntries(group.filter(([, value]) => value !== null)));
  };
  const answer = h("div", { class: "plan-answer", "aria-live": "polite" });
  const button = h("button", { type: "submit", class: "primary" }, t("plan.go"));
  const submit = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const read = readAll();
    if (!read) return;
    const [ofField, ofScanner, ofWanted, ofPart] = read;
    // A turntable alone has a plan of its own; beside other edges it is one of them.
    const told = edges(), plain = Object.keys(told).every((name) => name === "axes") && (told.axes ?? []).every((axis) => axis === TURNTABLE);
    const cell = { scanner: ofField, ...ofScanner, ...ofWanted, arm: arm.select.value, sphere_class: sphere.select.value, ...(plain ? table.checked && { table: ofPart } : told) };
    button.disabled = true;
    answer.replaceChildren(h("p", { class: "soft" }, t("plan.wait")));
    await during(async () => answer.replaceChildren(...found(await (await request("/plan", json("POST", cell))).json())));
    if (!problem.hidden) answer.replaceChildren();
    button.disabled = false;
  };
  const simulate = () => during(async () => {
    const read = readAll();
    if (!read) return;
    const [ofField, ofScanner, ofWanted] = read, seed = 1 + Math.floor(Math.random() * SEEDS);
    const cell = { ...edges(), scanner: ofField, point_sigma_mm: ofScanner?.point_sigma_mm, sphere_diameter_mm: ofWanted?.sphere_diameter_mm, scans: SCANS };
    const session = await api.createSession(/** @type {any} */ ({ name: t("way.simulated_name", { seed }), simulated: { scenario: "described", seed, cell } }));
    dialog.close();
    go(`/sessions/${session.id}`);
  });
  const dialog = opened("plan", t("plan.title"), h("p", { class: "soft" }, t("plan.how")),
    h("form", { class: "plan-form", novalidate: true, onsubmit: submit },
      h("h3", {}, t("plan.scanner")), h("div", { class: "fields" }, ...[...field, ...scanner].map(({ element }) => element)),
      h("h3", {}, t("plan.cell")), h("div", { class: "fields" }, arm.element, sphere.element, ...wanted.map(({ element }) => element)),
      tableRow, ofTable,
      h("details", {}, h("summary", {}, t("chain.title")), h("div", { class: "fields" }, machine.element), chain),
      h("div", { class: "row end" }, h("button", { type: "button", needs: "capture", onclick: () => void simulate() }, t("plan.simulate")), button)), problem, answer);
}

/** @param {CellPlan} plan @returns {HTMLElement[]} */
function found(plan) {
  const state = plan.reachable === null ? "plan" : plan.reachable ? "pass" : "fail";
  const rows = plan.spheres.map((one) => {
    const after = one.captures ? one.after_mm[one.captures - 1] : one.uncertainty_mm;
    return [h("span", {}, `${fixed(one.diameter_mm, 1)} mm`), one.captures === null ? "–" : String(one.captures), plusMinus(after ?? one.uncertainty_mm, "mm")];
  });
  const layouts = plan.table?.layouts.map((one) => [`${fixed(one.radius_mm, 0)} mm`, String(one.heights_mm.length), String(one.angles), String(one.captures), plusMinus(one.uncertainty_mm, "mm")]);
  return [
    h("p", { class: `plan-sentence ${state}` }, h("strong", {}, said((plan.edges ?? plan).sentence))),
    ...(plan.edges ? edgesFound(plan.edges) : []),
    h("p", {}, t("plan.seen", { distance: fixed(plan.distance_mm, 0), offset: fixed(plan.offset_mm, 0) })),
    h("p", {}, plan.where), h("p", { class: "soft" }, t("plan.limited", { limited_by: plan.limited_by })),
    tableOf([t("plan.sphere"), t("plan.captures"), t("plan.then")], rows, t("plan.sphere")),
    ...(plan.table && layouts ? [h("p", {}, h("strong", {}, said(plan.table.sentence))),
      tableOf([t("plan.off_axis"), t("plan.heights"), t("plan.angles"), t("plan.captures"), t("plan.then")], layouts, t("plan.table"))] : []),
  ];
}


/** What the captures tell of each edge, and the captures. @param {EdgesPlan} plan @returns {HTMLElement[]} */
function edgesFound({ edges, captures, unseen }) {
  const known = edges.map(({ title, position_mm: mm, orientation_deg: deg, open }) => [said(title), mm === null ? "–" : plusMinus(mm, "mm"), deg === null ? "–" : plusMinus(deg, "°"), open.map(said).join(" ")]);
  const taken = captures.map((one, index) => [
    String(index + 1), [one.scanner ?? "", one.sphere].filter(Boolean).join(" · "), axesWords(one) || "–",
    one.by_robot ? one.base_from_tool0.slice(0, 3).map((row) => fixed(row[3] ?? 0, 0)).join(" ") : "–", one.uncertainty_mm === null ? "–" : plusMinus(one.uncertainty_mm, "mm"),
  ]);
  return [
    ...unseen.map((one) => h("p", {}, said(one))),
    tableOf([t("plan.edge"), t("plan.edge_position"), t("plan.edge_orientation"), t("plan.edge_open")], known, t("plan.edge")),
    h("details", {}, h("summary", {}, t("captures.many", { count: captures.length })), tableOf(["#", t("plan.seen_by"), t("column.axes"), t("plan.flange"), t("plan.then")], taken, t("plan.captures"))),
  ];
}
