// A piece of equipment in a form: what it is, by what it is identified, its certificate and how it expands.

import "../texts/later.js";
import { field, h } from "../dom.js";
import { inField, typedNumber } from "../format.js";
import { json, request } from "../state/http.js";
import { maybe, t } from "../texts.js";
import { attempt, notify } from "../components/toasts.js";

/** @import {Certificate, Equipment} from "../api-types.js" */

const KINDS = ["sphere", "bar", "plate", "scanner", "robot", "table"];
const TEXTS = /** @type {const} */ (["name", "model", "serial"]);
const OF_CERTIFICATE = /** @type {const} */ (["number", "laboratory", "issued", "due"]);
const PER_K = 1e-6;

/** @param {string} kind */
export const kindWords = (kind) => maybe(`equipment.kind_${kind}`, kind);

/** What identifies a piece, in one line. @param {Equipment} piece */
export const pieceWords = ({ kind, name, model, serial }) => [kindWords(kind), name, model, serial].filter(Boolean).join(" · ");

/**
 * The fields of a piece; `read` answers undefined where a number is none, and says so at its field.
 * @param {string} ids begins the ids of the fields
 * @param {Equipment} [piece]
 */
export function pieceFields(ids, piece) {
  /** What the fields do not show stays. @type {Equipment} */
  let known = piece ?? { kind: "sphere" };
  const kinds = KINDS.includes(known.kind) || !known.kind ? KINDS : [...KINDS, known.kind];
  const kind = h("select", {}, ...kinds.map((one) => h("option", { value: one }, kindWords(one))));
  const texts = new Map([...TEXTS, ...OF_CERTIFICATE].map((name) => [name, h("input", { autocomplete: "off", maxlength: 200, ...(name === "issued" || name === "due" ? { type: "date" } : {}) })]));
  const expansion = number(), reference = number();
  const put = () => {
    kind.value = known.kind || "sphere";
    for (const name of TEXTS) /** @type {HTMLInputElement} */ (texts.get(name)).value = String(known[name] ?? "");
    for (const name of OF_CERTIFICATE) /** @type {HTMLInputElement} */ (texts.get(name)).value = String(known.certificate?.[name] ?? "").slice(0, name === "issued" || name === "due" ? 10 : undefined);
    expansion.value = String(inField(known.expansion_per_k == null ? null : Number((known.expansion_per_k / PER_K).toPrecision(6))));
    reference.value = String(inField(known.reference_c ?? null));
  };
  put();
  const named = (/** @type {(typeof TEXTS)[number] | (typeof OF_CERTIFICATE)[number]} */ name) => field(`${ids}-${name}`, t(`equipment.${name}`), /** @type {HTMLInputElement} */ (texts.get(name)));
  const element = h("div", { class: "more-fields even" },
    field(`${ids}-kind`, t("equipment.kind"), kind), ...TEXTS.map(named), ...OF_CERTIFICATE.map(named),
    field(`${ids}-expansion`, t("equipment.expansion"), expansion, t("equipment.expansion_hint")),
    field(`${ids}-reference`, t("equipment.reference"), reference, t("equipment.reference_hint")));
  /** @returns {Equipment | undefined} */
  const read = () => {
    const [per_k, reference_c] = [valueOf(expansion), valueOf(reference)];
    if (per_k === undefined || reference_c === undefined) return undefined;
    const told = (/** @type {readonly string[]} */ names) => Object.fromEntries(names.map((name) => [name, texts.get(/** @type {"name"} */ (name))?.value.trim() || null]));
    const certificate = { ...known.certificate, ...told(OF_CERTIFICATE) };
    return /** @type {Equipment} */ (onlyTold({
      ...known, kind: kind.value, ...told(TEXTS), certificate: Object.values(certificate).some(Boolean) ? onlyTold(certificate) : null,
      expansion_per_k: per_k === null ? null : per_k * PER_K, reference_c,
    }));
  };
  /** @param {Equipment} found of a certificate */
  const take = (found) => {
    known = /** @type {Equipment} */ ({ ...known, ...onlyTold(found), kind: found.kind || kind.value, certificate: { ...known.certificate, ...onlyTold(found.certificate ?? {}) } });
    put();
  };
  return { element, read, take };
}

/** A button that reads a digital certificate into fields. @param {(found: Equipment) => void} take */
export function certificateButton(take) {
  const input = h("input", { type: "file", accept: ".xml,.dcc" });
  input.addEventListener("change", () => void attempt(async () => {
    const file = input.files?.[0];
    if (!file) return;
    /** @type {Certificate} */
    const found = await (await request("/certificates", json("POST", { xml: await file.text(), of_sphere: false }))).json();
    take(found.equipment);
    notify(t("equipment.certificate_taken", { number: found.identifier || file.name }));
    input.value = "";
  }));
  return h("button", { type: "button", class: "plain", onclick: () => input.click() }, t("equipment.read_certificate"));
}

const number = () => {
  const input = h("input", { inputmode: "decimal", autocomplete: "off" });
  input.addEventListener("input", () => input.setCustomValidity(""));
  return input;
};

/** Null where it is empty, undefined where it is no number. @param {HTMLInputElement} input */
export function valueOf(input) {
  if (!input.value.trim()) return null;
  const value = typedNumber(input.value);
  if (Number.isFinite(value)) return value;
  input.setCustomValidity(t("form.need_number"));
  input.reportValidity();
  return undefined;
}

/** What is told, without what is not. @param {object} values @returns {Record<string, any>} */
const onlyTold = (values) => Object.fromEntries(Object.entries(values).filter(([, value]) => value !== null && value !== undefined));
