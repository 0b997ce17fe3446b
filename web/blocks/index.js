// A result's evidence as sections of the page: one renderer for each kind of block. A block that has an element of its
// stage in place of it is drawn by that.

import { h } from "../dom.js";
import { said, t } from "../texts.js";
import { plot } from "../result/plot.js";
import { figures } from "./figure.js";
import { frame } from "./frame.js";
import { note } from "./note.js";
import { picture } from "./picture.js";
import { table } from "./table.js";

/** @import {Block, FigureBlock} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */
/** @typedef {{ state: SessionState, stage: string }} Context */
/** @typedef {(block: Block, context: Context) => HTMLElement | null} Renderer an element of a stage */

/**
 * The sections, each when it is asked for.
 * @param {readonly Block[]} blocks
 * @param {Context} context
 * @param {Readonly<Record<string, Renderer>>} [own] by the blocks' ids
 * @returns {Generator<HTMLElement>}
 */
export function* sections(blocks, context, own = {}) {
  for (const group of grouped(blocks)) {
    const [first] = group;
    if (!first) continue;
    const title = first.title ? said(first.title) : t("evidence.title");
    const parts = [...drawn(group, context, own)];
    if (!parts.length) continue;
    const id = `evidence-${context.stage}-${blocks.indexOf(first)}`;
    if (group.every(({ detail }) => detail)) yield h("details", { class: "panel" }, h("summary", {}, title), ...parts);
    else yield h("section", { class: "panel", "aria-labelledby": id }, h("h2", { id }, title), ...parts);
  }
}

/** A block with a title begins a section. @param {readonly Block[]} blocks */
function grouped(blocks) {
  /** @type {Block[][]} */
  const groups = [];
  for (const block of blocks) {
    if (block.title || !groups.length) groups.push([]);
    groups.at(-1)?.push(block);
  }
  return groups;
}

/** @param {Block[]} group @param {Context} context @param {Readonly<Record<string, Renderer>>} own */
function* drawn(group, context, own) {
  for (let index = 0; index < group.length; index++) {
    const block = group[index];
    if (!block) continue;
    const replaced = block.id ? own[block.id]?.(block, context) : null;
    if (replaced) yield replaced;
    else if (block.kind === "figure") {
      const row = /** @type {FigureBlock[]} */ (following(group, index));
      index += row.length - 1;
      yield figures(row);
    } else yield one(block, context);
  }
}

/** Figures that follow each other make one list. @param {Block[]} group @param {number} from */
function following(group, from) {
  const end = group.findIndex((block, index) => index > from && block.kind !== "figure");
  return group.slice(from, end < 0 ? undefined : end);
}

/** @param {Block} block @param {Context} context */
function one(block, { state, stage }) {
  if (block.kind === "frame") return frame(block, state.results[stage]?.verdict === "fail");
  if (block.kind === "table") return table(block, state);
  if (block.kind === "picture") return picture(block, state);
  if (block.kind === "plot") {
    const caption = h("figcaption", { class: "soft small" }, said(block.caption));
    return h("figure", { class: "evidence-plot" }, plot(block, state, caption), caption);
  }
  return block.kind === "note" ? note(block) : h("p", { class: "soft" }, t("evidence.unknown", { kind: block.kind }));
}
