// Which captures can be taken again.

/** @import {CaptureOut, Kind} from "../state/model.js" */

const KINDS = /** @type {readonly Kind[]} */ (["profile", "cloud", "frame"]);

/**
 * Captures of several files and centres without one are sent again as they were sent first. The simulated cell takes those
 * of the sphere again.
 * @param {CaptureOut} capture
 * @param {boolean} simulated
 * @param {boolean} isOfSphere whether it shows the sphere
 */
export function isReplaceable({ kind, files }, simulated, isOfSphere) {
  if (simulated) return kind !== "frame" && kind !== "sweep" && isOfSphere;
  return KINDS.includes(kind) && files?.length === 1;
}
