// What a message says in one line; all of it opens. The rule: its first sentence, without what stands in brackets (a direction stays,
// with as many digits as a glance takes). Where that is more than a line, it ends with the last clause that fits, or is cut.

/** A line of the answer's card holds so many letters, in however many words; a Chinese sign is as wide as two. */
const MOST_LETTERS = 72, SIGN = /[\u2e80-\uffef]/gu;
/** A clause of fewer words says nothing by itself. */
const FEWEST_LETTERS = 24, FEWEST_WORDS = 4;
const BRACKETS = /[ \u00a0]*[(（]([^()（）]*)[)）]/gu, DIRECTION = /^[\u2212-]?\d[\d.,]*[,;] [^a-z]*$/, DECIMALS = /\d+([.,])\d\d+/g;
/** What is left of a list whose last part stood in brackets. */
const LIST_END = /[,、]?\s*(?:and|und|和)(?=[:：])/gu;
const SENTENCE_END = /(?<=[.!?])\s+(?=[A-ZÄÖÜ])|[。！？]/u, CLAUSE_END = /[:;,](?=\s)(?![^(]*\))|[：；，]/gu;
/** What goes on with the verb that a German clause before the comma still needs. */
const LACKS_VERB = /^, (?:wird|werden|wurden?|ist|sind|war|waren|hat|haben|kann|können|darf|dürfen|muss|müssen|gibt|liegt|liegen|steht|stehen|passt|passen|zeigt|zeigen|ergibt|ergeben|weicht|weichen|widerspricht|widersprechen)\b/u;
/** @param {string} text */
const fits = (text) => letters(text) <= MOST_LETTERS;

/** Of a text, without its directions. @param {string} text */
const letters = (text) => text.replace(BRACKETS, "").replace(SIGN, "xx").length;

/** @param {string} text in the reader's language */
export function brief(text) {
  const bare = text.replace(BRACKETS, (all, held) => (DIRECTION.test(held) ? all.replace(DECIMALS, (one, sign) => Number(one.replace(",", ".")).toFixed(1).replace(".", sign)) : "")).replace(LIST_END, "");
  const line = (bare.split(SENTENCE_END)[0] ?? "").replace(/[.。]$/u, "");
  if (fits(line.replace(BRACKETS, ""))) return line;
  const clauses = [...line.matchAll(CLAUSE_END)].filter(({ index }) => !LACKS_VERB.test(line.slice(index))).map(({ index }) => line.slice(0, index));
  return clauses.findLast((one) => fits(one) && (letters(one) >= FEWEST_LETTERS || one.split(" ").length > FEWEST_WORDS)) ?? `${cut(line)} …`;
}

/** As many words as fit; of a language without spaces, signs. @param {string} line */
function cut(line) {
  const words = line.split(" ");
  while (words.length > 1 && !fits(words.join(" "))) words.pop();
  const most = words.join(" ");
  return fits(most) ? most : most.slice(0, MOST_LETTERS / (SIGN.test(most) ? 2 : 1));
}
