// Sending captures one after another, so that their order stays and one bad file stops nothing but itself.

import { api } from "./api.js";
import { Problem } from "./http.js";
import { t } from "../texts.js";

/** @import {Capture} from "./model.js" */
/** @import {Folder, Found} from "./files.js" */
/** @typedef {{ record: Capture, files: File[], missing?: string[] }} Parcel */
/** @typedef {{ sent: Capture[], files: File[], problems: string[], left: Parcel[] }} Outcome `sent`: the captures, `files` what they are made of; `left`: what could not be stored, so that nothing is lost */

/** What could not be stored while a session was made, until its page takes it. @type {Map<string, Parcel[]>} */
const waiting = new Map();

/** @param {string} sessionId */
export function takeWaiting(sessionId) {
  const parcels = waiting.get(sessionId) ?? [];
  waiting.delete(sessionId);
  return parcels;
}

/** Files that came before their session was made, until its page takes them. @type {Map<string, Found[]>} */
const brought = new Map();

/** @param {string} sessionId @param {Found[]} found */
export const bring = (sessionId, found) => void brought.set(sessionId, found);

/** @param {string} sessionId */
export function takeBrought(sessionId) {
  const found = brought.get(sessionId) ?? [];
  brought.delete(sessionId);
  return found;
}

/** Where pose lines that were typed stand until they are sent. @param {string} sessionId */
export const draftKey = (sessionId) => `scancell-draft-${sessionId}`;

/** Whether anything waits for a session's page. @param {string} sessionId */
export const isAwaited = (sessionId) => waiting.has(sessionId) || brought.has(sessionId);

/**
 * @param {string} sessionId
 * @param {readonly Parcel[]} parcels
 * @param {(sent: number, all: number) => void} progress
 * @returns {Promise<Outcome>}
 */
export async function send(sessionId, parcels, progress) {
  /** @type {string[]} */
  const problems = [];
  /** @type {Capture[]} */
  const sent = [];
  /** @type {File[]} */
  const files = [];
  /** @type {Parcel[]} */
  const left = [];
  for (const [index, parcel] of parcels.entries()) {
    progress(index, parcels.length);
    if (parcel.missing?.length) {
      problems.push(t("problem.lacking", { capture: parcel.record.id, files: parcel.missing.join(", ") }));
      continue;
    }
    try {
      await api.addCapture(sessionId, parcel.record, parcel.files);
      sent.push(parcel.record);
      files.push(...parcel.files);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      left.push(parcel);
      problems.push(error.body.detail?.startsWith(`${parcel.record.id}:`) ? error.body.detail : `${parcel.record.id}: ${error.body.detail ?? error.message}`);
      if (error.status === 0) break;
    }
  }
  progress(parcels.length, parcels.length);
  return { sent, files, problems, left };
}

/**
 * A new session from a folder that was dropped.
 * @param {Folder} folder
 * @param {(sent: number, all: number) => void} progress
 */
export async function createFromFolder(folder, progress) {
  const session = await api.createSession(/** @type {import("./model.js").SessionBody} */ (folder.record));
  const outcome = await send(session.id, folder.captures, progress);
  if (outcome.left.length) waiting.set(session.id, outcome.left);
  return { session, outcome };
}

/**
 * The first free id in a row of names like p01, p02, …
 * @param {ReadonlySet<string>} taken
 * @param {string} wanted
 */
export function freeId(taken, wanted) {
  const clean = wanted.replace(/[^A-Za-z0-9._-]/g, "-").replace(/^[^A-Za-z0-9]+/, "").slice(0, 56);
  if (clean && !taken.has(clean)) return clean;
  for (let number = 1; ; number++) {
    const id = `p${String(number).padStart(2, "0")}`;
    if (!taken.has(id)) return id;
  }
}
