// What a step of the calibration adds to the session page; another step is another file beside tcp.js.

import { camera } from "./camera.js";
import { laserPlane } from "./laser-plane.js";
import { merge } from "./merge.js";
import { tcp } from "./tcp.js";
import { chain, turntable } from "./turntable.js";

/** @import {StageResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */

/**
 * @typedef {object} StepPage
 * @property {(result: StageResult, state: SessionState) => HTMLElement[]} summary what stands in the rail
 * @property {(result: StageResult, state: SessionState) => Iterable<HTMLElement | null>} result the sections of the result view
 */

/** @type {Record<string, StepPage>} */
export const steps = { camera, "laser-plane": laserPlane, tcp, turntable, chain, merge };
