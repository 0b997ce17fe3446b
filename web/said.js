// What the server says in English, in another language: sentences are recognised by their templates, whose {} hold what changes.

/** @typedef {Record<string, string>} Table from a template to its translation; {2} there names the second hole */

const ESCAPED = /[.*+?^$()|[\]\\]/g;
const HOLE = /\{(\d?)\}/g;
/** Names as the server lists them: `p03, p07 and p09`, `f13–f24 and 3 more`. */
const LIST = /^(\S+(?:, \S+)*) and (\S+|\d+ more)$/;
/** A template of few words is no sentence: it holds no list and no two sentences. */
const FEW = 4, JOINED = / (?:and|or) |[.] /;
/** The frame of a refusal: what it holds is said by itself. */
const REFUSAL = /need {}, got/i;
/** What is added to a sentence in brackets. */
const ADDED = /^(.*)( \([^()]*\)\.?)$/;
/** More than a hole should hold where it can be taken apart; a place is a name or two, no sentence. */
const SEVERAL = /: |[.] [A-Z]/, PLACE = /^([^ :]+(?: [^ :]+)?): (.+)$/s;
const BETWEEN_SENTENCES = /(?<=[.!?]) (?=[A-Z±"])/;

/** How a language joins what English joins by spaces, commas and "and". */
const JOINS = /** @type {const} */ ({
  de: { sentences: " ", and: " und ", or: " oder ", more: "weitere", comma: ", ", colon: ": " },
  zh: { sentences: "", and: "和", or: "或", more: "个其他", comma: "、", colon: "：" },
});

export class Sayings {
  /** @type {Map<string, string>} */ #known = new Map();
  /** @type {{ few: boolean, swallows: boolean, pattern: RegExp, words: string }[] | null} made when first asked: refusals first, then the longest, as it says most */ #patterns = null;
  /** @type {Map<string, string>} */ #said = new Map();
  #joins;

  /** @param {"de" | "zh"} language */
  constructor(language) {
    this.#joins = JOINS[language];
  }

  /** @param {Table} table */
  add(table) {
    for (const [template, words] of Object.entries(table)) this.#known.set(template, words);
    this.#patterns = null;
    this.#said.clear();
  }

  /** Whether a text stands in a table as it is. @param {string} text */
  knows(text) {
    return this.#known.has(text);
  }

  /** A text of the server, as far as it is known; the rest stays as it is. @param {string} text @returns {string} */
  say(text) {
    const before = this.#said.get(text);
    if (before !== undefined) return before;
    const words = this.#say(text);
    this.#said.set(text, words);
    return words;
  }

  /** The same for a part of a text. @param {string} text @returns {string} */
  #say(text) {
    return this.#whole(text) ?? this.#sentences(text);
  }

  /** One template's text, as it stands or as it stands within others: with or without a stop, begun small. @param {string} text @returns {string | null} */
  #whole(text) {
    return this.#exact(text) ?? this.#exact(`${text}.`)?.replace(/[.。]$/u, "") ?? this.#unstopped(text) ?? this.#begunSmall(text);
  }

  /** @param {string} text */
  #unstopped(text) {
    const words = text.endsWith(".") ? this.#exact(text.slice(0, -1)) : null;
    return words === null ? null : `${words}${this.#joins.sentences ? "." : "。"}`;
  }

  /** @param {string} text */
  #begunSmall(text) {
    const small = text.charAt(0).toLowerCase() + text.slice(1);
    const words = small === text ? null : this.#exact(small) ?? this.#exact(`${small}.`)?.replace(/[.。]$/u, "") ?? this.#unstopped(small);
    return words == null ? null : words.charAt(0).toUpperCase() + words.slice(1);
  }

  /** @param {string} text @returns {string | null} */
  #exact(text) {
    const known = this.#known.get(text);
    if (known !== undefined) return known;
    this.#patterns ??= [...this.#known].filter(([template]) => template.includes("{}")).sort(([a], [b]) => Number(REFUSAL.test(b)) - Number(REFUSAL.test(a)) || b.length - a.length).map(([template, words]) => ({
      swallows: /^\{\}|\{\}[.]?$/.test(template) && !/need \{\}/i.test(template),
      few: !/:|need /.test(template) && (template.match(/[A-Za-z]{2,}/g)?.length ?? 0) < FEW, pattern: new RegExp(`^${template.split("{}").map((part) => part.replace(ESCAPED, "\\$&")).join("(.*?)")}$`, "s"), words }));
    for (const { few, swallows, pattern, words } of this.#patterns) {
      const found = pattern.exec(text);
      if (few && found?.slice(1).some((held) => JOINED.test(held) && !LIST.test(held))) continue;
      if (!found) continue;
      const apart = swallows && [found[1], found.at(-1)].some((held) => held && SEVERAL.test(held) && this.#whole(held) === null) ? this.#apart(text) : null;
      let next = 0;
      return apart ?? words.replace(HOLE, (_, place) => this.#part(found[place ? Number(place) : ++next] ?? ""));
    }
    return null;
  }

  /** Where a hole would swallow a place that stands before, or a sentence that follows: each by itself, if all are known. @param {string} text @returns {string | null} */
  #apart(text) {
    const [, place, rest] = PLACE.exec(text) ?? [];
    const told = rest && this.#whole(rest);
    if (told) return `${this.#say(place ?? "")}${this.#joins.colon}${told}`;
    const parts = text.split(BETWEEN_SENTENCES);
    const words = parts.length > 1 ? parts.map((part) => this.#whole(part)) : [null];
    return words.includes(null) ? null : words.join(this.#joins.sentences);
  }

  /** What a hole holds: a number or a name, a text again, or a list of them. @param {string} text @returns {string} */
  #part(text) {
    if (!/[a-z]{2}/i.test(text)) return text;
    const words = this.#say(text);
    return words === text ? text.split(/( and | or )/).map((one) => (one === " and " ? this.#joins.and : one === " or " ? this.#joins.or : this.#say(one))).join("") : words;
  }

  /** A list of names, or what is put together of several: each by itself. @param {string} text @returns {string} */
  #sentences(text) {
    const list = LIST.exec(text);
    if (list) return `${list[1]?.replaceAll(", ", this.#joins.comma)}${this.#joins.and}${list[2]?.replace(/ more$/, ` ${this.#joins.more}`)}`;
    const [, before, added] = ADDED.exec(text) ?? [];
    const words = added && this.#whole(added);
    if (before && words) return `${this.#say(before)}${words}`;
    const parts = text.split(BETWEEN_SENTENCES);
    if (parts.length > 1) return parts.map((part) => this.#say(part)).join(this.#joins.sentences);
    const colon = text.indexOf(": ");
    if (colon < 0) return text;
    const head = this.#whole(text.slice(0, colon + 1));
    if (head !== null) return `${head}${this.#joins.sentences}${this.#say(text.slice(colon + 2))}`;
    return `${this.#say(text.slice(0, colon))}${this.#joins.colon}${this.#say(text.slice(colon + 2))}`;
  }
}
