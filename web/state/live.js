// The live cell of a session: its devices, and its previews, each asked for when the last one was drawn.

import { clock } from "../format.js";
import { session } from "./api.js";
import { json, request, ROOT } from "./http.js";
import { language } from "../texts.js";

/** @import {CaptureSettings, Devices, MoverChoice, TableMover, TakenShot} from "../api-types.js" */

/**
 * @typedef {{ name: string, delivers: string[], status: string, problem: string, fresh: boolean, why: string, rate_hz: number, age_s: number }} LiveDevice
 * @typedef {{ size: [number, number], stripe: [number, number][], arc: [number, number][], stripe_width_px: number | null, brightness: number, saturated: number, exposure_advice: string, focus_advice: string }} LivePicture
 * @typedef {{ name: string, age_s: number, points: [number, number][], on_arc: boolean[], circle: [number, number, number] | null, rms_mm: number | null, extent_deg: number | null, zone: number | null, problem: string, weak: string, picture: LivePicture | null }} LiveExposure
 * @typedef {{ base_from_tool0: number[][] | null, joints_deg: number[] | null, moving: boolean | null, age_s: number }} LiveRobot
 * @typedef {{ version: number, step: string, devices: LiveDevice[], automatic: boolean, waits_for: string, is_taken: boolean, robot: LiveRobot | null, table_deg: number | null, exposure: LiveExposure | null, clocks: { offset_s: number, sigma_s: number, drift_s: number, warning: string } | null, last: { id: string, verdict: string, zone: number | null, text: string } | null, image: boolean }} Preview
 */

const AGAIN_MS = 500;
/** Faster than this nobody sees more. */
const LEAST_MS = 40;

/** What is older is not shown as current. */
export const OLD_S = 2;

/** The time of day so many seconds ago. @param {number} age_s */
export const ago = (age_s) => clock(new Date(Date.now() - 1000 * age_s));

export const live = {
  /** @param {string} id @returns {Promise<Devices>} */
  devices: async (id) => (await request(`${session(id)}/devices`)).json(),

  /** @param {string} id @param {string} name @param {{ source: string, settings: Record<string, unknown>, connected: boolean }} body @returns {Promise<Devices>} */
  put: async (id, name, body) => (await request(`${session(id)}/devices/${encodeURIComponent(name)}`, json("PUT", body))).json(),

  /** @param {string} id @param {string} name */
  remove: async (id, name) => void (await request(`${session(id)}/devices/${encodeURIComponent(name)}`, json("DELETE"))),

  /** @param {string} id @param {CaptureSettings} settings */
  set: async (id, settings) => void (await request(`${session(id)}/live`, json("PUT", settings))),

  /** Measure the offset between the clocks, after a move back and forth. @param {string} id */
  measureClocks: async (id) => void (await request(`${session(id)}/live/clock-offset`, json("POST", {}))),

  /** What can turn the table. @returns {Promise<MoverChoice[]>} */
  movers: async () => (await (await request("/movers")).json()).items,

  /** What is armed for a session. @param {string} id @returns {Promise<TableMover>} */
  mover: async (id) => (await request(`${session(id)}/table-mover`)).json(),

  /** @param {string} id @param {Record<string, unknown>} arming @returns {Promise<TableMover>} */
  arm: async (id, arming) => (await request(`${session(id)}/table-mover`, json("PUT", arming))).json(),

  /** @param {string} id */
  disarmTable: async (id) => void (await request(`${session(id)}/table-mover`, json("DELETE"))),

  /** Turn the table and wait until it rests. @param {string} id @param {number} angle */
  turn: async (id, angle) => void (await request(`${session(id)}/table-mover/go`, json("POST", { table_deg: angle }))),

  /** @param {string} id */
  stopTable: async (id) => void (await request(`${session(id)}/table-mover/stop`, json("POST"))),

  /** Record every exposure and the robot's poses as one capture. @param {string} id @param {{ seconds: number, table_deg?: number, why?: string }} body @returns {Promise<TakenShot>} */
  sweep: async (id, body) => (await request(`${session(id)}/live/sweep`, json("POST", body))).json(),

  /** Take a capture once all stand still. @param {string} id @param {{ table_deg?: number, why?: string }} body @returns {Promise<TakenShot>} */
  capture: async (id, body) => (await request(`${session(id)}/live/capture`, json("POST", body))).json(),
};

/**
 * Show previews until the returned function is called; the next one is asked for after `draw` is done.
 * @param {string} id
 * @param {(preview: Preview, image: ImageBitmap | null) => Promise<void>} draw
 * @returns {() => void} stop
 */
export function followPreviews(id, draw) {
  /** @type {WebSocket | null} */
  let socket = null;
  let timer = 0;
  let drawnMs = 0;

  const open = () => {
    const one = new WebSocket(`${window.location.origin.replace(/^http/, "ws")}${ROOT}${session(id)}/live/preview?lang=${language}`);
    one.binaryType = "blob";
    socket = one;
    /** @type {Preview | null} */
    let waiting = null;
    const next = () => { if (one.readyState === WebSocket.OPEN) one.send("next"); };
    const show = async (/** @type {Preview} */ preview, /** @type {ImageBitmap | null} */ image) => {
      await draw(preview, image);
      image?.close();
      const restMs = LEAST_MS - (performance.now() - drawnMs);
      timer = window.setTimeout(next, Math.max(0, restMs));
      drawnMs = performance.now();
    };
    one.onopen = next;
    one.onmessage = async ({ data }) => {
      if (typeof data === "string") {
        const preview = /** @type {Preview} */ (JSON.parse(data));
        if (preview.image) waiting = preview;
        else await show(preview, null);
        return;
      }
      const preview = waiting;
      waiting = null;
      const image = await createImageBitmap(data).catch(() => null);
      if (preview) await show(preview, image);
    };
    one.onclose = () => {
      if (socket !== one) return;
      timer = window.setTimeout(open, AGAIN_MS);
    };
  };

  open();
  return () => {
    window.clearTimeout(timer);
    const last = socket;
    socket = null;
    last?.close();
  };
}
