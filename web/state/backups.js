// A controller's backup that was read, kept while the page is open: the tool goes back into a copy of it.

/** @import {Found} from "./files.js" */
/** @import {ControllerFile} from "./model.js" */
/** @typedef {{ found: Found[], content: ControllerFile }} Backup */

/** @type {Map<string, Backup>} */
const kept = new Map();

/** @param {string} sessionId @param {Backup} backup */
export function remember(sessionId, backup) {
  kept.set(sessionId, backup);
}

/** @param {string} sessionId */
export const backupOf = (sessionId) => kept.get(sessionId);
