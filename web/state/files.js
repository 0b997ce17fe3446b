// What was dropped: single files, or a whole session folder with its session.json.

import { json, request } from "./http.js";
import { registry } from "./registries.js";

/** @import {Capture, Kind} from "./model.js" */
/** @typedef {{ path: string, file: File }} Found */

/** What files with an ending can hold. @type {Map<string, Kind[]>} */
const kinds = new Map();

/** Ask which files there are; `kindOf` knows it from then on. */
export async function knowFormats() {
  for (const format of await registry("formats")) {
    if (!format.reads) continue;
    for (const ending of format.endings) kinds.set(ending, [...new Set([...kinds.get(ending) ?? [], ...format.kinds])]);
  }
}

/** @param {string} name */
const baseOf = (name) => name.split("/").at(-1) ?? name;

/** @param {string} name */
export const stemOf = (name) => baseOf(name).replace(/\.[^.]+$/, "");

/** @param {string} name */
const endingOf = (name) => (/\.[^.]+$/.exec(name)?.[0] ?? "").toLowerCase();

/** When a capture was taken, by the clock that dated its file. @param {File | undefined} file */
export const takenOf = (file) => (file ? { taken: new Date(file.lastModified).toISOString(), clock: /** @type {const} */ ("file") } : {});

/** @param {Found} found */
export const isArchive = (found) => endingOf(found.path) === ".zip";

/**
 * The kind of capture that a file holds; where its format leaves that open, what the cell's scanner delivers.
 * @param {string} name
 * @param {string | null | undefined} scannerKind
 * @returns {Kind}
 */
export function kindOf(name, scannerKind) {
  const possible = kinds.get(endingOf(name)) ?? ["profile"];
  return possible.find((kind) => kind === scannerKind) ?? possible[0] ?? "profile";
}

/**
 * All files of a drop, folders included, in the order of their names.
 * @param {DataTransfer} transfer
 * @returns {Promise<Found[]>}
 */
export async function dropped(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  if (!entries.length) return ordered([...transfer.files].map((file) => ({ path: file.name, file })));
  return ordered((await Promise.all(entries.map(walk))).flat());
}

/**
 * All files of a file field, with their paths where a folder was chosen.
 * @param {HTMLInputElement} input
 * @returns {Found[]}
 */
export function chosen(input) {
  return ordered([...(input.files ?? [])].map((file) => ({ path: file.webkitRelativePath || file.name, file })));
}

/** @param {Found[]} found */
function ordered(found) {
  return found.sort((a, b) => a.path.localeCompare(b.path, "en", { numeric: true }));
}

/**
 * @param {FileSystemEntry} entry
 * @returns {Promise<Found[]>}
 */
async function walk(entry) {
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => /** @type {FileSystemFileEntry} */ (entry).file(resolve, reject));
    return [{ path: entry.fullPath.replace(/^\//, ""), file }];
  }
  const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
  /** @type {FileSystemEntry[]} */
  const children = [];
  for (;;) {
    // A reader gives its entries in portions and an empty one at the end.
    const portion = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!portion.length) break;
    children.push(...portion);
  }
  return (await Promise.all(children.map(walk))).flat();
}

/**
 * @typedef {object} Folder a session folder as it was dropped
 * @property {Record<string, unknown>} record session.json without its captures
 * @property {{ record: Capture, files: File[], missing: string[] }[]} captures
 */

/**
 * The session folder among the files, if there is one.
 * @param {Found[]} found
 * @returns {Promise<Folder | null>}
 * @throws {SyntaxError} where session.json is not JSON
 */
export async function sessionFolder(found) {
  const head = found.find(({ path }) => baseOf(path) === "session.json");
  if (!head) return null;
  const { captures = [], ...record } = JSON.parse(await head.file.text());
  const robot = record.cell?.robot;
  const root = head.path.slice(0, head.path.length - "session.json".length);
  const byPath = new Map(found.map(({ path, file }) => [path, file]));
  const urdf = byPath.get(`${root}${robot?.arm}`);
  if (urdf) robot.arm = await (await request("/arms", json("POST", { xml: await urdf.text(), name: urdf.name }))).json();
  return { record, captures: /** @type {Capture[]} */ (captures).map((capture) => withFiles(capture, root, byPath)) };
}

/**
 * @param {Capture} record
 * @param {string} root
 * @param {Map<string, File>} byPath
 */
function withFiles(record, root, byPath) {
  const names = record.files ?? [];
  const files = names.map((name) => byPath.get(root + name));
  return { record, files: files.filter((file) => file !== undefined), missing: names.filter((_, index) => !files[index]) };
}

/**
 * Put pose lines to files: by the name that a line begins with, otherwise by their order.
 * @param {readonly string[]} names of files
 * @param {readonly string[]} lines
 * @returns {{ file: number | null, line: number | null }[]} rows, files first, in their order
 */
export function match(names, lines) {
  const wanted = lines.map((line) => /^\s*"?([^\s,;"]*[A-Za-z_][^\s,;"]*)/.exec(line)?.[1] ?? null);
  const byName = new Map(names.flatMap((name, index) => [[baseOf(name), index], [stemOf(name), index]]));
  const named = wanted.map((name) => (name === null ? undefined : byName.get(name)));
  if (named.some((index) => index !== undefined)) {
    const lineOf = new Map(named.flatMap((index, line) => (index === undefined ? [] : [[index, line]])));
    const rows = names.map((_, file) => ({ file, line: lineOf.get(file) ?? null }));
    const left = named.flatMap((index, line) => (index === undefined || lineOf.get(index) !== line ? [{ file: null, line }] : []));
    return [...rows, ...left];
  }
  const count = Math.max(names.length, lines.length);
  return Array.from({ length: count }, (_, index) => ({ file: index < names.length ? index : null, line: index < lines.length ? index : null }));
}
