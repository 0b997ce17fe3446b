// Every text of the page comes from one catalogue, in the language that the browser asks for.

/** @typedef {typeof import("./texts/en.js").texts & typeof import("./texts/live/en.js").texts & typeof import("./texts/guidance/en.js").texts & typeof import("./texts/access/en.js").texts & typeof import("./texts/compare/en.js").texts & typeof import("./texts/start/en.js").texts & typeof import("./texts/merged/en.js").texts & typeof import("./texts/timeline/en.js").texts & typeof import("./texts/cell/en.js").texts & typeof import("./texts/dialogs/en.js").texts & typeof import("./texts/settings/en.js").texts & typeof import("./texts/plots/en.js").texts & typeof import("./texts/release/en.js").texts & typeof import("./texts/devices/en.js").texts} Texts */
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

/**
 * A text of the catalogue, with its `{places}` filled.
 * @param {Text} key
 * @param {Record<string, string | number>} [values]
 * @returns {string}
 */
export function t(key, values = {}) {
  return catalogue[key].replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? ""));
}

/** What the server says in English, in the chosen language: what a first view needs at once, the rest once something is said that it lacks. */
const sayings = language === "en" ? null : new (await import("./said.js")).Sayings(language);
sayings?.add((await import(`./texts/server/${language}.js`)).texts);
/** What results, guide and evidence say. */
const SENTENCES = ["sphere", "guide", "captures", "stages", "results", "labels"];
/** What the server says when it refuses something, a file a part of it: needed only then. */
const REFUSALS = ["names", "formats", "exports", "robots", "archive", "requests"];
/** What is not known yet, in the order in which it is looked through. */
let later = [...SENTENCES, ...REFUSALS];
/** @type {Promise<void> | null} */
let learning = null;

/** Told once more is known of what was said before. */
export const SAID = "scancell-said";

/** What results, guide and evidence say; English needs none. */
export const learnSentences = () => learn(SENTENCES);

/** How formats, exports and sources are called. */
export const learnNames = () => learn(["names"]);

/** Everything that the server says. */
export const learnRefusals = () => learn([...SENTENCES, ...REFUSALS]);

/** @param {string[]} parts */
async function learn(parts) {
  if (!sayings) return;
  const lacking = later.filter((part) => parts.includes(part));
  const tables = await Promise.all(lacking.map((part) => import(`./texts/server/${language}/${part}.js`)));
  for (const { texts } of tables) sayings.add(texts);
  later = later.filter((part) => !lacking.includes(part));
}

async function learnWhatLacks() {
  do await learn(later.slice(0, 1)); while (later.length && sayings?.lacks());
  learning = null;
  window.dispatchEvent(new Event(SAID));
}

/** What the server says, in the chosen language as far as the catalogue has it. @param {string} text @returns {string} */
export function said(text) {
  const words = sayings?.say(text) ?? text;
  if (later.length && sayings?.lacking) learning ??= learnWhatLacks();
  return words;
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
 */
export function maybe(key, otherwise) {
  return key in catalogue ? t(/** @type {Text} */ (key)) : otherwise;
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
