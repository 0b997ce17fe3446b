// A sentence or two; where it carries a verdict, with its sign.

import { h } from "../dom.js";
import { mark } from "../icons.js";
import { said } from "../texts.js";

/** @import {NoteBlock} from "../state/model.js" */

/** @param {NoteBlock} block */
export function note({ text, level = "info" }) {
  return level === "info" ? h("p", { class: "soft small" }, said(text)) : h("p", { class: `reason reason-${level}` }, mark(level, said(text)));
}
