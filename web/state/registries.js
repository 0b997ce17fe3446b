// What exists, asked for once: stages, formats, conventions, exports, sources and brands with the schemas of their settings.

import { api } from "./api.js";
import { maybe, said, t } from "../texts.js";

/** @import {ConventionInfo, StageInfo} from "./model.js" */
/** @typedef {Parameters<typeof api.registry>[0]} Sort */

/** @type {Map<Sort, Promise<any[]>>} */
const asked = new Map();

/** @param {Sort} sort */
export function registry(sort) {
  let answer = asked.get(sort);
  if (!answer) {
    answer = api.registry(sort);
    asked.set(sort, answer);
    answer.catch(() => asked.delete(sort));
  }
  return answer;
}

/** The same for a choice, under the names that the page's language has for them, each with what proved it. @param {"formats" | "exports" | "sources"} sort */
export async function offered(sort) {
  const entries = await registry(sort);
  return entries.map((entry) => ({ ...entry, title: entry.proof ? t("proof.beside", { what: said(entry.title), proof: proofWords(entry.proof) }) : said(entry.title) }));
}

/** What proved a reader or writer of foreign files. @param {string} proof */
export const proofWords = (proof) => maybe(`proof.${proof}`, proof);

/** In the order of the way. @returns {Promise<StageInfo[]>} */
export const stages = () => registry("stages");

/** The most common first. @returns {Promise<ConventionInfo[]>} */
export const conventions = () => registry("conventions");
