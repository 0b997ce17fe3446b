// A form from a JSON Schema, as the registries give it: a field for each plain property, with what the schema says of it.

import "../texts/later.js";
import { h } from "../dom.js";
import { inField, typedNumber, typedNumbers } from "../format.js";
import { maybe, said, t } from "../texts.js";

/** @typedef {{ type?: string, title?: string, description?: string, default?: unknown, enum?: unknown[], anyOf?: Schema[], items?: Schema, properties?: Record<string, Schema>, exclusiveMinimum?: number, minimum?: number }} Schema */

/**
 * @param {Schema} schema
 * @param {Record<string, unknown>} values what is set now
 * @param {{ prefix: string, go: string, submit: (values: Record<string, unknown>) => Promise<unknown>, needs?: string, ids?: string }} options `prefix` begins the keys of labels, `ids` the fields' ids
 */
export function schemaForm(schema, values, { prefix, go, submit, needs = "capture", ids = prefix }) {
  const fields = Object.entries(schema.properties ?? {}).flatMap(([name, one]) => {
    const made = field(name, plainOf(one), values[name] ?? one.default, prefix, ids);
    return made ? [{ name, ...made }] : [];
  });
  const send = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const read = fields.map(({ name, read: one }) => /** @type {const} */ ([name, one()]));
    if (read.some(([, value]) => value === undefined)) return;
    await submit(Object.fromEntries(read));
  };
  return h("form", { class: "schema-form", novalidate: true, onsubmit: send }, ...fields.map(({ element }) => element),
    h("div", { class: "row end" }, h("button", { type: "submit", ...(needs ? { needs } : {}) }, go)));
}

/** What a property is beside null. @param {Schema} schema @returns {Schema} */
const plainOf = (schema) => ({ ...schema.anyOf?.find(({ type }) => type !== "null"), ...schema });

/**
 * @param {string} name
 * @param {Schema} schema
 * @param {unknown} value
 * @param {string} prefix
 * @param {string} ids
 */
function field(name, { type, items, enum: choices, title, description, exclusiveMinimum, minimum }, value, prefix, ids) {
  const id = `${ids}-${name.replaceAll("_", "-")}`;
  const label = maybe(`settings.${prefix}.${name}`, title ?? name);
  const hint = maybe(`settings.${prefix}.${name}_hint`, description ? said(description) : "");
  const described = hint ? { "aria-describedby": `${id}-hint` } : {};
  const below = hint ? h("span", { class: "hint", id: `${id}-hint` }, hint) : null;
  if (type === "boolean") {
    const input = h("input", { id, type: "checkbox", checked: value === true, ...described });
    return { element: h("div", { class: "field" }, h("div", { class: "row" }, input, h("label", { for: id }, label)), below), read: () => input.checked };
  }
  const wrap = (/** @type {HTMLElement} */ control) => h("div", { class: "field" }, h("label", { for: id }, label), control, below);
  if (choices) {
    const none = value === null ? [h("option", { value: "" }, maybe(`settings.${prefix}.${name}_none`, t("settings.usual")))] : [];
    const select = h("select", { id, ...described }, ...none, ...choices.map((one) => h("option", { value: String(one), selected: one === value }, maybe(`settings.${prefix}.${name}_${one}`, maybe(`${name}.${one}`, String(one))))));
    return { element: wrap(select), read: () => select.value || null };
  }
  if (type === "array" && (items?.type === "number" || items?.type === "string")) {
    const list = listInput(id, items.type === "number", value, described);
    return { element: wrap(list.input), read: list.read };
  }
  const numeric = type === "number" || type === "integer";
  if (!numeric && type !== "string") return null;
  const input = h("input", { id, autocomplete: "off", inputmode: numeric ? "decimal" : "text", value: inField(value), ...described });
  input.addEventListener("input", () => input.setCustomValidity(""));
  const read = () => {
    if (!numeric) return input.value.trim() || null;
    if (!input.value.trim()) return null;
    const number = typedNumber(input.value);
    const good = Number.isFinite(number) && !(exclusiveMinimum !== undefined && number <= exclusiveMinimum) && !(minimum !== undefined && number < minimum);
    input.setCustomValidity(good ? "" : t("form.need_number"));
    return input.reportValidity() ? number : undefined;
  };
  return { element: wrap(input), read };
}

/**
 * A list, its values apart by commas or spaces; node ids keep their semicolons.
 * @param {string} id
 * @param {boolean} numeric
 * @param {unknown} value
 * @param {{ "aria-describedby"?: string | undefined }} described
 */
function listInput(id, numeric, value, described) {
  const shown = Array.isArray(value) ? value.map(inField).join(" ") : "";
  const input = h("input", { id, autocomplete: "off", value: shown, ...described });
  input.addEventListener("input", () => input.setCustomValidity(""));
  const read = () => {
    const words = input.value.split(/[\s,]+/).filter(Boolean);
    if (!words.length) return null;
    if (!numeric) return words;
    const numbers = typedNumbers(input.value);
    input.setCustomValidity(numbers.every(Number.isFinite) ? "" : t("form.need_number"));
    return input.reportValidity() ? numbers : undefined;
  };
  return { input, read };
}
