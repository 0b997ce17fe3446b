// Every text of the page comes from one catalogue, in the language that the browser asks for.

/** @typedef {typeof import("./texts/en.js").texts & typeof import("./texts/live/en.js").texts & typeof import("./texts/guidance/en.js").texts & typeof import("./texts/access/en.js").texts & typeof import("./texts/compare/en.js").texts & typeof import("./texts/start/en.js").texts & typeof import("./texts/merged/en.js").texts & typeof import("./texts/timeline/en.js").texts & typeof import("./texts/cell/en.js").texts & typeof import("./texts/dialogs/en.js").texts & typeof import("./texts/settings/en.js").texts & typeof import("./texts/plots/en.js").texts & typeof import("./texts/release/en.js").texts & typeof import("./texts/devices/en.js").texts & typeof import("./texts/files/en.js").texts} Texts */
/** @typedef {keyof Texts} Text */

export const LANGUAGES = /** @type {const} */ (["en", "de", "zh"]);
const KEY = "scancell-language";

/** The first language that the user chose, here or in the browser, and that there is. */
export const language = [window.localStorage.getItem(KEY), ...navigator.languages].map((one) => (one ?? "").slice(0, 2).toLowerCase())
  .flatMap((wanted) => LANGUAGES.filter((one) => one === wanted))[0] ?? "en";

/** @type {Record<Text, string>} */
const catalogue = { ...(await import(`./texts/${language}.js`)).texts };

/** Texts of a part of the page that is loaded when it is asked for: a folder beside `en/`. @param {string} part */
export async function learnTexts(part) {
  Object.assign(catalogue, (await import(`./texts/${part}/${language}.js`)).texts);
}

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

/** What the server says in English, in the chosen language: the sentences that were asked for so far. */
const sayings = language === "en" ? null : new (await import("./sentences.js")).Sayings(language);

/** Has words, and is no name of a capture, a file or a place. */
const WORDS = /[a-z]{2}/i, NAME = /^\S*[\d_/\\]\S*$/;
/** One question holds no more; the server takes twice that. */
const MOST_LETTERS = 8000;
/** Texts that the server was asked for or will be, each number in them as 0, and whether it has answered. @type {Map<string, boolean>} */
const asked = new Map();
/** @type {string[]} */
let waiting = [];
/** One question after another. */
let asking = Promise.resolve();
/** Whether something was shown in English that was asked for. */
let shownEarly = false;

/** Told once more is known of what was said before. */
export const SAID = "scancell-said";

/** @param {string} text */
const plainly = (text) => text.slice(0, MOST_LETTERS).replace(/\d+/g, "0");

/** @param {string} text @returns {boolean} whether it is new, and may have words in another language */
function wonder(text) {
  const plain = plainly(text);
  if (!sayings || asked.has(plain) || sayings.knows(text) || !WORDS.test(text) || NAME.test(text)) return false;
  asked.set(plain, false);
  waiting.push(plain);
  return true;
}

/** @returns {string[]} the next that fit into one question */
function question() {
  let letters = 0;
  const end = waiting.findIndex((text) => (letters += text.length) > MOST_LETTERS);
  return waiting.splice(0, end < 0 ? waiting.length : Math.max(1, end));
}

/** Ask for the sentences that occur in what waits; who showed some of it as it came shows it again. */
async function ask() {
  let answered = false;
  while (waiting.length) {
    const texts = question();
    const init = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ texts }) };
    /** @type {Record<string, string> | null} */
    const table = await fetch(`/said/${language}`, init).then((answer) => (answer.ok ? answer.json() : null)).catch(() => null);
    for (const text of texts) {
      if (table) asked.set(text, true);
      else asked.delete(text); // until it is said again
    }
    if (table) sayings?.add(table);
    answered ||= table !== null;
  }
  if (!answered || !shownEarly) return;
  shownEarly = false;
  window.dispatchEvent(new Event(SAID));
}

/** Know the words for every text in what the server has answered, before it is shown. @param {unknown} answer */
export async function learn(answer) {
  if (!sayings) return;
  for (const text of textsIn(answer)) wonder(text);
  await (asking = asking.then(ask));
}

/** @param {unknown} value @returns {Generator<string>} */
function* textsIn(value) {
  if (typeof value === "string") yield value;
  else if (value && typeof value === "object") for (const part of Object.values(value)) yield* textsIn(part);
}

/** Before a number, a hyphen is a minus. */
const HYPHEN = /(?<=^|[\s(])-(?=\d)/g;
/** A number with decimals, which is no version, address, name or part of one. */
const DECIMAL = /(?<![\w.\-/\\]|[Vv]ersion )\d+\.\d+(?![\w/\\]|\.\w)/g;
/** What a convention is called in a record. */
const CONVENTION = /['„“]([a-z]+(?:-[a-z]+)?)['“”]/g;
/** What was typed or is to be typed stays as it is. */
const VERBATIM = /(`[^`]*`|„[^“]*“|'[^']*'|"[^"]*")/;

/** What the server says, in the chosen language as far as it is known; the rest is asked for, and said again. @param {string} [text] @returns {string} */
export const said = (text = "") => bound(inLanguage(spoken(text).replace(HYPHEN, "\u2212").replace(CONVENTION, (quoted, name) => maybe(`convention.${name}`, quoted))));

/** Numbers in a sentence, with the sign that its readers expect; those in a row are then apart by semicolons. @param {string} text */
const inLanguage = (text) => (language === "zh" ? text.replace(/([。；，：]) /gu, "$1") : language !== "de" || !text.includes(".") ? text
  : text.split(VERBATIM).map((part, place) => (place % 2 ? part : part.replace(DECIMAL, pointed).replace(/(\d,\d+), (?=[\u2212±]?\d+(?:,\d|$))/g, "$1; "))).join(""));

/** A ± stays beside its number, and a number beside its unit, where a line ends. @param {string} text */
const bound = (text) => (/[±\d]/.test(text) ? text.replace(/(?<=\d) ±/g, "\u00a0±").replace(/± (?=\d)/g, "±\u00a0").replace(/(?<=\d) (?=(?:mm|µm|px|°|kB|MB|GB|ms|s|σ|%)(?![\w²]))/g, "\u00a0") : text);

/** @param {string} text */
function spoken(text) {
  if (!sayings) return text;
  if (wonder(text) && waiting.length === 1) asking = asking.then(ask);
  if (asked.get(plainly(text)) !== false) return sayings.say(text);
  shownEarly = true; // half of a sentence is not said before all of it is known
  return text;
}

/** A refusal: its need, got and what to do are said each by itself, whatever they hold. @param {import("./state/model.js").ProblemBody} body */
export function refusal({ detail, title, need, got, to_do: toDo }) {
  const told = `need ${need}, got ${got}. ${toDo}`;
  if (!sayings || !detail?.endsWith(told)) return said(detail ?? title ?? "");
  const place = detail.slice(0, -told.length - 2);
  return `${place && `${said(place)}: `}${said(`Need ${need}, got ${got}.`)}${language === "zh" ? "" : " "}${said(toDo ?? "")}`;
}

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
 */
export function plural(count, one, many) {
  return t(count === 1 ? one : many, { count });
}
