// Rows under columns; a row that is about a capture picks it, in the plots and the scene as well.

import { h } from "../dom.js";
import { glossed } from "../components/glossary.js";
import { fixed } from "../format.js";
import { quantityWords } from "./quantity.js";
import { said } from "../texts.js";

/** @import {CellOf, ColumnOf, TableBlock, RowOf} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const ROWS_AT_ONCE = 200;

/** @param {TableBlock} block @param {SessionState} state */
export function table({ caption, columns, rows }, state) {
  return h("div", { class: "table-block" }, caption && h("p", { class: "soft small" }, glossed(said(caption))), h("div", { class: "table-holder", tabindex: 0, role: "region", "aria-label": said(caption || (columns[0]?.label ?? "")) },
    h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...columns.map((column) => h("th", { scope: "col", class: column.align !== "left" && "right" }, glossed(headOf(column)))))),
      fillLater(h("tbody"), rows, (row) => line(row, columns, state)))));
}

/** Many rows are added a few at a time, so that the page stays fluid. @param {HTMLElement} body @param {readonly RowOf[]} rows @param {(row: RowOf) => HTMLElement} make */
function fillLater(body, rows, make, from = 0) {
  body.append(...rows.slice(from, from + ROWS_AT_ONCE).map(make));
  if (from + ROWS_AT_ONCE < rows.length) setTimeout(() => fillLater(body, rows, make, from + ROWS_AT_ONCE));
  return body;
}

/** @param {ColumnOf} column */
const headOf = ({ label, unit }) => (unit ? `${said(label)}, ${unit}` : said(label));

/** @param {RowOf} row @param {ColumnOf[]} columns @param {SessionState} state */
function line({ cells, capture, used = true, reason }, columns, state) {
  const pick = () => capture && state.select(capture);
  return h("tr", { class: used ? "" : "out", "data-capture": capture ?? false, title: reason ? said(reason) : false }, ...cells.map((cell, index) => {
    const words = cellWords(cell, columns[index]);
    if (index > 0) return h("td", { class: columns[index]?.align !== "left" && "right" }, words);
    return h("th", { scope: "row" }, capture ? h("button", { type: "button", class: "plain pick", onclick: pick }, words) : words, !used && reason && h("span", { class: "why" }, said(reason)));
  }));
}

/** @param {CellOf} cell @param {ColumnOf | undefined} column */
function cellWords(cell, column) {
  if (cell === null || typeof cell === "string") return cell ? said(cell) : "–";
  return typeof cell === "number" ? fixed(cell, column?.decimals ?? 0) : quantityWords(cell);
}
