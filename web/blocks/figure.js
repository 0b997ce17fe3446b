// Numbers with their labels, one below the other.

import { h } from "../dom.js";
import { glossed } from "../components/glossary.js";
import { quantityWords } from "./quantity.js";
import { said } from "../texts.js";

/** @import {FigureBlock} from "../state/model.js" */

/** @param {readonly FigureBlock[]} blocks */
export function figures(blocks) {
  return h("dl", { class: "pairs number" }, ...blocks.map((block) => h("div", {},
    h("dt", {}, glossed(said(block.label))),
    h("dd", {}, figureWords(block), limit(block), block.remark && h("span", { class: "soft small" }, ` ${said(block.remark)}`)))));
}

/** @param {FigureBlock} block */
export const figureWords = (block) => (block.text ? said(block.text) : null) ?? quantityWords(block.quantity);

/** @param {FigureBlock} block */
function limit({ limit: held, limit_label: label }) {
  return held ? h("span", { class: "soft small" }, ` ${label ? `${said(label)} ` : "/ "}${quantityWords(held)}`) : null;
}
