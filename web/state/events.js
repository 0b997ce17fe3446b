// Server-sent events that come back by themselves. The server gives a sign of life each second; where none comes, the page says so.

import { language } from "../texts.js";
import { requireLogin } from "./me.js";

const PAUSES_MS = [200, 400, 700, 1000];
/** So long after the last sign of life nothing is called current any more; after longer the connection is made anew. */
export const FRESH_MS = 2000;
const GIVEN_UP_MS = 6000;
const LOOK_MS = 250;

/** @typedef {"connecting" | "live" | "reconnecting"} Liveness */

/**
 * Follow an address until the returned function is called.
 * @param {string} address
 * @param {readonly string[]} names the events to hear
 * @param {(name: string, data: unknown) => void} heard
 * @param {(liveness: Liveness, again: boolean) => void} changed `again` where the connection had been lost, or could not be made, before
 * @param {() => void} [failed] each time that no connection could be made, or one broke
 * @returns {() => void} stop
 */
export function follow(address, names, heard, changed, failed) {
  /** @type {EventSource | null} */
  let source = null;
  let timer = 0;
  let tries = 0;
  let again = false;
  let liveness = /** @type {Liveness} */ ("connecting");
  let aliveMs = performance.now();
  let askedMs = aliveMs;
  let lookedMs = 0;

  const tell = (/** @type {Liveness} */ now, afresh = false) => {
    if (now === liveness && !afresh) return;
    liveness = now;
    again ||= now === "reconnecting";
    changed(now, afresh);
  };
  const alive = () => {
    aliveMs = performance.now();
    if (liveness !== "live" && again) tell("live", true);
  };
  const open = () => {
    source?.close();
    askedMs = performance.now();
    source = new EventSource(`${address}${address.includes("?") ? "&" : "?"}lang=${language}`);
    source.onopen = () => {
      tries = 0;
      aliveMs = performance.now();
      tell("live", again);
      again = true;
    };
    source.onerror = () => {
      source?.close();
      tell("reconnecting");
      void requireLogin();
      failed?.();
      window.clearTimeout(timer);
      timer = window.setTimeout(open, PAUSES_MS[Math.min(tries++, PAUSES_MS.length - 1)]);
    };
    source.addEventListener("alive", alive);
    for (const name of names) {
      source.addEventListener(name, (event) => {
        alive();
        heard(name, JSON.parse(event.data));
      });
    }
  };
  const look = () => {
    const nowMs = performance.now();
    const [silentMs, busyMs] = [nowMs - aliveMs, nowMs - lookedMs];
    lookedMs = nowMs;
    // A page that was busy itself first hears what came meanwhile.
    if (!source || source.readyState === EventSource.CLOSED || busyMs > 4 * LOOK_MS) return;
    if (silentMs > FRESH_MS) tell("reconnecting"); // one that is asked for and never comes, too
    if (Math.min(silentMs, nowMs - askedMs) > GIVEN_UP_MS) open();
  };
  const soon = () => {
    if (source?.readyState !== EventSource.CLOSED) return;
    window.clearTimeout(timer);
    open();
  };

  open();
  const looking = window.setInterval(look, LOOK_MS);
  window.addEventListener("online", soon);
  return () => {
    window.removeEventListener("online", soon);
    window.clearInterval(looking);
    window.clearTimeout(timer);
    source?.close();
  };
}
