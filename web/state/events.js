// Server-sent events that come back by themselves, with growing pauses, and say when they did.

import { requireLogin } from "./me.js";

const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 15000;

/** @typedef {"connecting" | "live" | "reconnecting"} Liveness */

/**
 * Follow an address until the returned function is called.
 * @param {string} address
 * @param {readonly string[]} names the events to hear
 * @param {(name: string, data: unknown) => void} heard
 * @param {(liveness: Liveness, again: boolean) => void} changed `again` where the connection had been lost before
 * @returns {() => void} stop
 */
export function follow(address, names, heard, changed) {
  /** @type {EventSource | null} */
  let source = null;
  let timer = 0;
  let pause = FIRST_PAUSE_MS;
  let opened = false;

  const open = () => {
    source = new EventSource(address);
    source.onopen = () => {
      pause = FIRST_PAUSE_MS;
      changed("live", opened);
      opened = true;
    };
    source.onerror = () => {
      source?.close();
      changed(opened ? "reconnecting" : "connecting", false);
      void requireLogin();
      timer = window.setTimeout(open, pause);
      pause = Math.min(pause * 2, LONGEST_PAUSE_MS);
    };
    for (const name of names) {
      source.addEventListener(name, (event) => heard(name, JSON.parse(event.data)));
    }
  };
  const soon = () => {
    if (source?.readyState !== EventSource.CLOSED) return;
    window.clearTimeout(timer);
    open();
  };

  open();
  window.addEventListener("online", soon);
  return () => {
    window.removeEventListener("online", soon);
    window.clearTimeout(timer);
    source?.close();
  };
}
