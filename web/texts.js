// Every text of the page comes from one catalogue, in the language that the browser asks for: the server makes it.

/** @typedef {import("./texts/names").Texts} Texts */
/** @typedef {keyof Texts} Text */

export const LANGUAGES = /** @type {const} */ (["en", "de", "zh"]);
const KEY = "scancell-language";

/** The first language that the user chose, here or in the browser, and that there is. */
export const language = [window.localStorage.getItem(KEY), ...navigator.languages].map((one) => (one ?? "").slice(0, 2).toLowerCase())
  .flatMap((wanted) => LANGUAGES.filter((one) => one === wanted))[0] ?? "en";

const AGAIN_MS = 1000;
const catalogue = /** @type {Record<Text, string>} */ ({});

/** Take texts into the catalogue, once the server gives them: by the area that begins their names. @param {"" | "later/"} place */
export async function take(place) {
  const address = new URL(`./texts/${place}${language}.json`, import.meta.url);
  /** @type {Record<string, Record<string, string>> | null} */
  let areas = null;
  while (!(areas = await fetch(address).then((answer) => (answer.ok ? answer.json() : null), () => null))) await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
  for (const [area, texts] of Object.entries(areas)) for (const [name, text] of Object.entries(texts)) catalogue[/** @type {Text} */ (name ? `${area}.${name}` : area)] = text;
}

await take("");

document.documentElement.lang = language === "zh" ? "zh-Hans" : language;

/** @param {string} chosen */
export function chooseLanguage(chosen) {
  window.localStorage.setItem(KEY, chosen);
  window.location.reload();
}

/** A number's digits with the decimal sign that readers of the page's language expect. @param {string} digits */
export const pointed = (digits) => (language === "de" ? digits.replace(".", ",") : digits);

/**
 * A text of the catalogue, with its `{places}` filled.
 * @param {Text} key
 * @param {Record<string, string | number>} [values]
 * @returns {string}
 */
export function t(key, values = {}) {
  return bound(catalogue[key].replace(/\{(\w+)\}/g, (_, name) => (typeof values[name] === "number" ? pointed(String(values[name])) : values[name] ?? "")));
}

/** Before a number, a hyphen is a minus. */
const HYPHEN = /(?<=^|[\s(])-(?=\d)/g;
/** A number with decimals, which is no version, address, name or part of one. */
const DECIMAL = /(?<![\w.\-/\\]|[Vv]ersion )\d+\.\d+(?![\w/\\]|\.\w)/g;
/** What a convention is called in a record. */
const CONVENTION = /['„“]([a-z]+(?:-[a-z]+)?)['“”]/g;
/** What was typed or is to be typed stays as it is. */
const VERBATIM = /(`[^`]*`|„[^“]*“|'[^']*'|"[^"]*")/;

/** What the server says, in the page's language already: with its signs, and numbers that stay beside their units. @param {string} [text] @returns {string} */
export const said = (text = "") => bound(inLanguage(text.replace(HYPHEN, "\u2212").replace(CONVENTION, (quoted, name) => maybe(`convention.${name}`, quoted))));

/** Numbers in a sentence, with the sign that its readers expect; those in a row are then apart by semicolons. @param {string} text */
const inLanguage = (text) => (language === "zh" ? text.replace(/([。；，：]) /gu, "$1") : language !== "de" || !text.includes(".") ? text
  : text.split(VERBATIM).map((part, place) => (place % 2 ? part : part.replace(DECIMAL, pointed).replace(/(\d,\d+), (?=[\u2212±]?\d+(?:,\d|$))/g, "$1; "))).join(""));

/** A ± stays beside its number, close where it stands alone, a range and k = 2 in one piece and a number beside its unit, where a line ends. @param {string} text */
const bound = (text) => (/[±\d]/.test(text) ? text.replace(/(?<=\d)–(?=\d)/g, "\u2060–\u2060").replace(/\bk = (?=\d)/g, "k\u00a0=\u00a0").replace(/(?<=\d) ±/g, "\u00a0±").replace(/(?<!\u00a0)± (?=\d)/g, "±").replace(/± (?=\d)/g, "±\u00a0").replace(/(?<=\d) (?=(?:mm|µm|px|°|kB|MB|GB|ms|s|σ|%)(?![\w²]))/g, "\u00a0") : text);

/**
 * A text whose key is put together from data; `otherwise` where the catalogue has none.
 * @param {string} key
 * @param {string} otherwise
 * @param {Record<string, string | number>} [values]
 */
export function maybe(key, otherwise, values) {
  return key in catalogue ? t(/** @type {Text} */ (key), values) : otherwise;
}

/**
 * One or many.
 * @param {number} count
 * @param {Text} one
 * @param {Text} many
 * @param {Record<string, string | number>} [others] values
 */
export function plural(count, one, many, others) {
  return t(count === 1 ? one : many, { count, ...others });
}
