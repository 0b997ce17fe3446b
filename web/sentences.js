// What the server says in English, in another language: sentences are recognised by their templates, whose {} hold what changes.

/** @typedef {Record<string, string>} Table from a template to its translation; {2} there names the second hole */

const ESCAPED = /[.*+?^$()|[\]\\]/g;
const HOLE = /\{(\d?)\}/g;
/** Names as the server lists them: `p03, p07 and p09`, `f13–f24 and 3 more`. */
const LIST = /^(\S+(?:, \S+)*) (and|or) (\S+|\d+ more)$/;
/** A template of few words is no sentence: it holds no list and no two sentences. */
const FEW = 4, JOINED = / (?:and|or) |[.] |: /;
/** The frame of a refusal: what it holds is said by itself. */
const REFUSAL = /need {}, got/i;
/** A frame's axis, or a direction in it. */
const AXIS = /^([a-z]+) ([xyz]|\([^a-z]*\))$/;
/** What is added to a sentence in brackets. */
const ADDED = /^(.*)( \([^()]*\)\.?)$/;
/** More than a hole should hold where it can be taken apart; a place is a name or two, no sentence. */
const SEVERAL = /: |[.] [A-Z]/, PLACE = /^([^ :]+(?: [^ :]+)?): (.+)$/s;
const BETWEEN_SENTENCES = /(?<=[.!?]) (?=[A-Z±"])/;

/** How a language joins what English joins by spaces, commas and "and". */
const JOINS = /** @type {const} */ ({
  de: { sentences: " ", stop: ".", and: " und ", or: " oder ", more: "weitere", comma: ", ", colon: ": " },
  zh: { sentences: "", stop: "。", and: "和", or: "或", more: "个其他", comma: "、", colon: "：" },
});

export class Sayings {
  /** @type {Map<string, string>} */ #known = new Map();
  /** @type {{ few: boolean, swallows: boolean, open: boolean, pattern: RegExp, words: string }[] | null} made when first asked: refusals first, then the longest, as it says most */ #patterns = null;
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
    return this.#told(text, false) ?? this.#told(text, true);
  }

  /** By templates of many words, or of few: what more words agree with comes first. @param {string} text @param {boolean} few @returns {string | null} */
  #told(text, few) {
    return this.#exact(text, few) ?? this.#exact(`${text}.`, few)?.replace(/[.。]$/u, "") ?? this.#unstopped(text, few) ?? this.#begunSmall(text, few);
  }

  /** @param {string} text @param {boolean} few */
  #unstopped(text, few) {
    const words = text.endsWith(".") ? this.#exact(text.slice(0, -1), few) : null;
    return words === null ? null : `${words}${this.#joins.stop}`;
  }

  /** @param {string} text @param {boolean} few */
  #begunSmall(text, few) {
    const small = text.charAt(0).toLowerCase() + text.slice(1);
    const words = small === text ? null : this.#exact(small, few) ?? this.#exact(`${small}.`, few)?.replace(/[.。]$/u, "") ?? this.#unstopped(small, few);
    return words == null ? null : words.charAt(0).toUpperCase() + words.slice(1);
  }

  /** @param {string} text @param {boolean} short @returns {string | null} */
  #exact(text, short) {
    const known = this.#known.get(text);
    if (known !== undefined) return known;
    this.#patterns ??= [...this.#known].filter(([template]) => template.includes("{}")).sort(([a], [b]) => Number(REFUSAL.test(b)) - Number(REFUSAL.test(a)) || b.length - a.length).map(([template, words]) => ({
      swallows: /^\{\}|\{\}[.]?$/.test(template) && !/need \{\}/i.test(template),
      open: template.endsWith("{}"), few: !/:|need /.test(template) && (template.match(/[A-Za-z]{2,}/g)?.length ?? 0) < FEW, pattern: new RegExp(`^${template.split("{}").map((part) => part.replace(ESCAPED, "\\$&")).join("(.*?)").replaceAll("\\.(.*?)", "\\.(?!\\d)(.*?)")}$`, "s"), words }));
    for (const { few, swallows, open, pattern, words } of this.#patterns) {
      const found = few === short ? pattern.exec(text) : null;
      if (few && found?.slice(1).some((held) => JOINED.test(held) && !LIST.test(held))) continue;
      if (!found) continue;
      const apart = swallows && [found[1], found.at(-1)].some((held) => held && SEVERAL.test(held) && this.#whole(held) === null) ? this.#apart(text) : null;
      if (apart !== null) return apart;
      // Where the last place ends the sentence, another language may put it elsewhere, or ends it otherwise: the stop is none of it.
      const last = found.at(-1) ?? "", stopped = open && last.endsWith(".") && !SEVERAL.test(last);
      if (stopped) found[found.length - 1] = last.slice(0, -1);
      let next = 0;
      return words.replace(HOLE, (_, place) => this.#part(found[place ? Number(place) : ++next] ?? "")) + (stopped ? this.#joins.stop : "");
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
    if (list) return `${list[1]?.replaceAll(", ", this.#joins.comma)}${list[2] === "or" ? this.#joins.or : this.#joins.and}${list[3]?.replace(/ more$/, ` ${this.#joins.more}`)}`;
    const [, frame, axis] = AXIS.exec(text) ?? [];
    if (frame) return `${this.#known.get(frame) ?? frame} ${axis}`;
    const [, before, added] = ADDED.exec(text) ?? [];
    const words = added && this.#whole(added);
    if (before && words && !before.includes(": ")) return `${this.#say(before)}${words}`;
    const parts = text.split(BETWEEN_SENTENCES);
    if (parts.length > 1) return parts.map((part) => this.#say(part)).join(this.#joins.sentences);
    const colon = text.indexOf(": ");
    if (colon < 0) return text;
    const head = this.#whole(text.slice(0, colon + 1));
    if (head !== null) return `${head}${this.#joins.sentences}${this.#say(text.slice(colon + 2))}`;
    return `${this.#say(text.slice(0, colon))}${this.#joins.colon}${this.#say(text.slice(colon + 2))}`;
  }
}
