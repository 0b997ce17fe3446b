// What a scene shows is drawn in English for all who look at it; a page in another language asks the server for its words.

import { json } from "../state/http.js";
import { language, said } from "../texts.js";

const WORDS = /[a-z]{2}/i;
/** One question holds no more. */
const MOST = 500;

/**
 * A function that says a text of the scene in the page's language, null where that is English. What is not known yet is asked for.
 * @param {() => void} known told when more is known
 * @returns {((text: string) => string) | null}
 */
export function sayer(known) {
  if (language === "en") return null;
  /** @type {Map<string, string>} */
  const words = new Map();
  /** @type {Set<string>} */
  const wanted = new Set();
  const ask = async () => {
    const texts = [...wanted].slice(0, MOST);
    const answer = await fetch(`/said/${language}`, json("POST", { texts })).catch(() => null);
    if (answer?.ok) for (const [text, told] of Object.entries(await answer.json())) words.set(text, said(told));
    for (const text of texts) wanted.delete(text);
    if (wanted.size) window.setTimeout(ask, 50); // what came meanwhile
    if (answer?.ok) known();
  };
  return (text) => {
    if (!words.has(text) && WORDS.test(text) && !wanted.has(text)) {
      wanted.add(text);
      if (wanted.size === 1) window.setTimeout(ask, 50);
    }
    return words.get(text) ?? text;
  };
}
