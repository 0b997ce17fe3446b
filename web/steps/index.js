// What a step of the calibration adds to the session page; another step is another file beside tcp.js. A step's file is
// loaded once there is a result of it.

import { unreachable } from "../api.js";

/** @import {StageResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */

/**
 * @typedef {object} StepPage
 * @property {(result: StageResult, state: SessionState) => HTMLElement[]} summary what stands in the rail
 * @property {(result: StageResult, state: SessionState) => Iterable<HTMLElement | null>} result the sections of the result view
 */

/** @type {Record<string, () => Promise<StepPage>>} in the order of the way */
const FILES = {
  camera: async () => (await import("./camera.js")).camera,
  "laser-plane": async () => (await import("./laser-plane.js")).laserPlane,
  tcp: async () => (await import("./tcp.js")).tcp,
  turntable: async () => (await import("./turntable.js")).turntable,
  chain: async () => (await import("./turntable.js")).chain,
  merge: async () => (await import("./merge.js")).merge,
};

/** The steps that have a page, in the order of the way. */
export const STEPS = Object.keys(FILES);

/** Those that are loaded. @type {Record<string, StepPage>} */
export const steps = {};

/** Load the pages of steps, so that their results can be shown. @param {readonly string[]} stages */
export async function loadSteps(stages) {
  await Promise.all(stages.map(async (stage) => {
    const file = FILES[stage];
    if (file && !steps[stage]) steps[stage] = await file().catch(() => { throw unreachable(); });
  }));
}
