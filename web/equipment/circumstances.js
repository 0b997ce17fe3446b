// With what, where, by whom and how warm it was captured: a session's equipment, temperatures and documentation.

import "../texts/later.js";
import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { inField } from "../format.js";
import { t } from "../texts.js";
import { did } from "../state/undo.js";
import { alarm, formButtons, openDialog } from "../components/dialog.js";
import { attempt } from "../components/toasts.js";
import { certificateButton, pieceFields, pieceWords, valueOf } from "./piece.js";

/** @import {Environment, Equipment, RegisteredEquipment} from "../api-types.js" */
/** @import {CaptureOut, SessionOut} from "../state/model.js" */

const TEMPERATURES = /** @type {const} */ (["ball_c", "air_c", "arm_c"]);
const TOLD = /** @type {const} */ (["operator", "place", "procedure", "report_number", "customer", "received", "replaces", "replaces_because"]);

/** @param {string} id */
export const circumstancesDialog = (id) => attempt(async () => open(...await Promise.all([api.session(id), api.equipment()])));

/** @param {SessionOut} session @param {RegisteredEquipment[]} register */
function open(session, register) {
  const { element: problem, during } = alarm();
  const pieces = piecesOf(session.cell.equipment ?? [], register);
  const warm = temperatureFields("session", session.environment ?? {});
  const documented = documentationFields(session.documentation ?? {});
  const dialog = openDialog("circumstances", t("circumstances.title"), [
    h("h3", {}, t("circumstances.equipment")), pieces.element,
    h("h3", {}, t("circumstances.temperatures")), h("p", { class: "soft small" }, t("circumstances.temperatures_words")), warm.element,
    h("h3", {}, t("circumstances.documentation")), documented.element,
    problem, formButtons(t("place.save")),
  ], { submit: async () => {
    const [environment, equipment] = [warm.read(), pieces.read()];
    if (!environment || !equipment) return;
    const after = { cell: { equipment: equipment.length ? equipment : null }, environment, documentation: documented.read() };
    const before = { cell: { equipment: session.cell.equipment ?? null }, environment: session.environment ?? null, documentation: session.documentation ?? null };
    if (!await during(() => api.changeSession(session.id, after))) return;
    dialog.close();
    did(t("circumstances.changed"), () => api.changeSession(session.id, before), { redo: () => api.changeSession(session.id, after) });
  } });
}

/** @param {Equipment[]} known @param {RegisteredEquipment[]} register */
function piecesOf(known, register) {
  let pieces = [...known];
  const list = h("ul", { class: "plain-list", "aria-live": "polite" });
  const choice = h("select", {});
  const from = h("div", { class: "row low" }, field("circumstances-register", t("circumstances.from_register"), choice),
    h("button", { type: "button", onclick: () => {
      const one = register.find(({ id }) => id === choice.value);
      if (one) put([...pieces, { kind: one.kind, name: one.name, serial: one.serial, register_id: one.id }]);
    } }, t("circumstances.add")));
  const fields = pieceFields("circumstances");
  let typed = false;
  fields.element.addEventListener("input", () => { typed = true; });
  const take = () => {
    const one = fields.read();
    if (!one) return false;
    put([...pieces, one]);
    typed = false;
    another.open = false;
    return true;
  };
  const another = h("details", {}, h("summary", {}, t("circumstances.another")),
    certificateButton((found) => { fields.take(found); typed = true; }), fields.element, h("div", { class: "row end" }, h("button", { type: "button", onclick: take }, t("circumstances.add"))));
  const put = (/** @type {Equipment[]} */ now) => {
    pieces = now;
    list.replaceChildren(...(pieces.length ? pieces.map((piece) => h("li", { class: "row" }, h("span", {}, pieceWords(piece)),
      h("button", { type: "button", class: "plain", "aria-label": t("equipment.remove", { name: pieceWords(piece) }), onclick: () => put(pieces.filter((one) => one !== piece)) }, t("equipment.take_away"))))
      : [h("li", { class: "soft" }, t("circumstances.no_equipment"))]));
    const left = register.filter(({ id }) => !pieces.some((one) => one.register_id === id));
    choice.replaceChildren(...left.map((one) => h("option", { value: one.id }, pieceWords(one))));
    from.hidden = left.length === 0;
  };
  put(pieces);
  // What was typed and not added yet is meant as well.
  const read = () => (another.open && typed && !take() ? undefined : pieces);
  return { element: h("div", {}, list, from, another), read };
}

/** @param {string} ids @param {Environment} known */
function temperatureFields(ids, known) {
  const inputs = TEMPERATURES.map((name) => {
    const input = h("input", { inputmode: "decimal", autocomplete: "off", value: inField(known[name] ?? null) });
    input.addEventListener("input", () => input.setCustomValidity(""));
    return /** @type {const} */ ([name, input]);
  });
  const element = h("div", { class: "more-fields even" }, ...inputs.map(([name, input]) => field(`${ids}-${name.replace("_", "-")}`, t(`circumstances.${name}`), input)));
  const read = () => {
    const values = inputs.map(([name, input]) => /** @type {const} */ ([name, valueOf(input)]));
    return values.some(([, value]) => value === undefined) ? undefined : Object.fromEntries(values);
  };
  return { element, read };
}

/** @param {Record<string, string>} known */
function documentationFields(known) {
  const inputs = TOLD.map((name) => /** @type {const} */ ([name, h("input", { autocomplete: "off", maxlength: 500, value: known[name] ?? "" })]));
  const rest = Object.entries(known).filter(([name]) => !TOLD.some((one) => one === name));
  const free = h("textarea", { rows: 3, maxlength: 5000, ".value": rest.map(([name, text]) => `${name}: ${text}`).join("\n") });
  const element = h("div", { class: "more-fields even" }, ...inputs.map(([name, input]) => field(`circumstances-${name.replace("_", "-")}`, t(`circumstances.${name}`), input)),
    field("circumstances-free", t("circumstances.free"), free, t("circumstances.free_hint")));
  const read = () => {
    const lines = free.value.split("\n").map((line) => line.trim()).filter(Boolean);
    const others = lines.map((line) => { const at = line.indexOf(":"); return at > 0 ? [line.slice(0, at).trim(), line.slice(at + 1).trim()] : ["note", line]; });
    const gone = Object.fromEntries(rest.map(([name]) => [name, null]));
    return { ...gone, ...Object.fromEntries(inputs.map(([name, input]) => [name, input.value.trim() || null])), ...Object.fromEntries(others) };
  };
  return { element, read };
}

/** Temperatures of chosen captures; what is left empty is the session's. @param {string} sessionId @param {readonly CaptureOut[]} captures */
export function temperatureDialog(sessionId, captures) {
  const { element: problem, during } = alarm();
  const warm = temperatureFields("captures", captures[0]?.environment ?? {});
  const dialog = openDialog("temperature", t("circumstances.of_captures", { count: captures.length }), [h("p", { class: "soft small" }, t("circumstances.of_captures_words")), warm.element, problem, formButtons(t("place.save"))], { submit: async () => {
    const environment = warm.read();
    if (!environment) return;
    const to = (/** @type {(capture: CaptureOut) => unknown} */ value) => async () => {
      for (const one of captures) await api.changeCapture(sessionId, one.id, { environment: value(one) });
    };
    const set = to(() => environment);
    if (!await during(set)) return;
    dialog.close();
    did(t("circumstances.changed"), to((one) => one.environment ?? null), { redo: set });
  } });
}
