// Terms that stand in labels, explained where the pointer or the focus rests on them.

import { h } from "../dom.js";
import { t } from "../texts.js";

const TERMS = /** @type {const} */ (["zone", "k", "left", "rms"]).map((term) => /** @type {const} */ ([t(`glossary.term_${term}`), t(`glossary.words_${term}`)]));

/** A label with the first term in it explained. @param {string} label */
export function glossed(label) {
  const found = TERMS.find(([term]) => label.includes(term));
  if (!found) return label;
  const [term, words] = found;
  const [before, after] = [label.slice(0, label.indexOf(term)), label.slice(label.indexOf(term) + term.length)];
  return h("span", {}, before, h("abbr", { title: words, tabindex: 0, "aria-description": words }, term), after);
}
