// Pasted tables of poses: which column is which number of the pose, the file's name, or the table's angle.

import { conventions } from "./registries.js";

/** @import {ConventionInfo, PoseConvention} from "./model.js" */
/** @typedef {{ head: string[] | null, rows: string[][] }} Table */
/** @typedef {string} Role a number's name in the convention, or one of `OTHERS` */

/** The numbers of a pose in their order, by convention. @type {Record<string, readonly string[]>} */
export const NUMBERS = {};

/** Ask which conventions there are. @returns {Promise<ConventionInfo[]>} */
export async function knowConventions() {
  const found = await conventions();
  for (const { name, numbers } of found) NUMBERS[name] = numbers.map((number, place) => number + "′".repeat(numbers.slice(0, place).filter((one) => one === number).length));
  return found;
}

/** What a column may be beside a number of the pose. */
export const OTHERS = /** @type {const} */ (["ignore", "file", "table"]);

const NUMBER = /^[+\-\u2212]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?$/i;
const TABLE_HEAD = /table|turn|angle|encoder|drehtisch/i;
const FILE_HEAD = /file|name|id|profile|scan|capture/i;

/**
 * The cells of pasted text; null where its lines are no table: blocks in braces, or rows of different lengths.
 * @param {string} text
 * @returns {Table | null}
 */
export function tableOf(text) {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() && !line.trim().startsWith("#"));
  if (!lines.length || /[{}]|^\s*\[/m.test(text)) return null;
  const separator = [/\t/, /;/, /,(?=\s|[^,]*,)/, /\s+/].find((one) => lines.every((line) => one.test(line.trim())));
  if (!separator) return null;
  const rows = lines.map((line) => line.trim().split(separator.source === ",(?=\\s|[^,]*,)" ? /,/ : separator).map((cell) => cell.trim().replace(/^"|"$/g, "")));
  const first = rows[0] ?? [];
  const head = first.some((cell) => NUMBER.test(cell)) ? null : first;
  const body = head ? rows.slice(1) : rows;
  return body.length && body.every((row) => row.length === first.length) ? { head, rows: body } : null;
}

/**
 * What each column most likely is: by its name, otherwise the columns of numbers in their order.
 * @param {Table} table
 * @param {PoseConvention} convention
 * @returns {Role[]}
 */
export function guessRoles({ head, rows }, convention) {
  const numbers = NUMBERS[convention] ?? [];
  const columns = rows[0]?.length ?? 0;
  /** @type {Role[]} */
  const roles = Array.from({ length: columns }, () => "ignore");
  if (head) {
    const plain = head.map((cell) => cell.toLowerCase().replace(/[\s_]*[([]?(mm|deg|rad|m|°)[)\]]?$/, ""));
    for (const name of numbers) {
      const exact = head.findIndex((cell, column) => roles[column] === "ignore" && cell.replace(/[\s_[(].*$/, "") === name);
      const column = exact >= 0 ? exact : plain.findIndex((cell, index) => roles[index] === "ignore" && cell === name.toLowerCase());
      if (column >= 0) roles[column] = name;
    }
    if (numbers.some((name) => !roles.includes(name))) roles.fill("ignore");
  }
  const numeric = (/** @type {number} */ column) => rows.every((row) => NUMBER.test(row[column] ?? ""));
  const words = roles.findIndex((role, column) => role === "ignore" && (!numeric(column) || (head !== null && FILE_HEAD.test(head[column] ?? ""))));
  if (words >= 0) roles[words] = "file";
  const angle = head?.findIndex((cell, column) => roles[column] === "ignore" && TABLE_HEAD.test(cell)) ?? -1;
  if (angle >= 0) roles[angle] = "table";
  if (!roles.includes(numbers[0] ?? "")) {
    const free = roles.flatMap((role, column) => (role === "ignore" && numeric(column) ? [column] : []));
    if (free.length >= numbers.length) numbers.forEach((name, index) => { roles[free[index] ?? 0] = name; });
  }
  return roles;
}

/**
 * A pose line for each row, as the server reads them: the file's name, then the numbers in the convention's order.
 * @param {Table} table
 * @param {readonly Role[]} roles
 * @param {PoseConvention} convention
 */
export function poseLines({ rows }, roles, convention) {
  const order = ["file", ...NUMBERS[convention] ?? []].map((role) => roles.indexOf(role)).filter((column) => column >= 0);
  return rows.map((row) => order.map((column) => plainNumber(row[column] ?? "")).join(" "));
}

/** @param {Table} table @param {readonly Role[]} roles @param {number} row */
export function angleIn({ rows }, roles, row) {
  const column = roles.indexOf("table");
  const cell = column < 0 ? undefined : rows[row]?.[column];
  return cell === undefined || cell === "" ? undefined : Number(plainNumber(cell).replace("\u2212", "-"));
}

/** With a point, whatever the table's country. @param {string} cell */
const plainNumber = (cell) => (NUMBER.test(cell) ? cell.replace(",", ".") : cell);
