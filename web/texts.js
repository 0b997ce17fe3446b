// Every text of the page comes from one catalogue; another language is another index and folder beside texts/en.js.

import { en } from "./texts/en.js";

/** @typedef {keyof typeof en} Text */

/**
 * A text of the catalogue, with its `{places}` filled.
 * @param {Text} key
 * @param {Record<string, string | number>} [values]
 * @returns {string}
 */
export function t(key, values = {}) {
  return en[key].replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? ""));
}

/**
 * A text whose key is put together from data; `otherwise` where the catalogue has none.
 * @param {string} key
 * @param {string} otherwise
 */
export function maybe(key, otherwise) {
  return key in en ? t(/** @type {Text} */ (key)) : otherwise;
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
