// How the page speaks HTTP: requests that are tried again while the server is away, and problems that say what to do.

import { language, said, t } from "../texts.js";

/** @import {Page, ProblemBody} from "./model.js" */

export const ROOT = "/api/v1";
export const LOGIN = "/login";
/** How long a server that starts anew is waited for. */
const PATIENCE_MS = [300, 700, ...Array(11).fill(1000)];
/** Who is asked to wait for longer than this is told so. */
const LONGEST_WAIT_S = 5;
const NO_CONTENT = 204;
/** How often, and how long after, a part of the page is asked for that did not come. */
const PART_TURNS = 120;
const PART_PAUSE_MS = 1000;
/** So long another page may take to come; a download leaves this one where it is. */
const LEAVING_MS = 5000;

/** As a sentence begins; a file's name stays as it is. @param {string} text */
const sentence = (text) => (/^\S+\.\w+[:：]/u.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1));

/** A request that the server refused, or that never reached it; `message` says what to do. */
export class Problem extends Error {
  /** @param {ProblemBody} body */
  constructor(body) {
    super(sentence(said(body.detail ?? body.title)));
    this.name = "Problem";
    this.body = body;
  }

  get status() {
    return this.body.status;
  }
}

/** A name that nobody else has; unlike `randomUUID` it works without a secure context, too. @param {number} [length] in bytes */
export function randomName(length = 8) {
  return Array.from(crypto.getRandomValues(new Uint8Array(length)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A key that lets the server recognise the same request sent twice. */
const idempotencyKey = () => randomName(16);

/** @param {number} milliseconds */
const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

/** Tells `lost` when the server does not answer and is asked again, and `back` when it does. */
export const link = new EventTarget();
let isLost = false;

/** @param {boolean} lost */
export function linked(lost) {
  if (lost !== isLost) link.dispatchEvent(new Event(lost ? "lost" : "back"));
  isLost = lost;
}

/**
 * Load a part of the page, again and again while the server is away: nobody asks for it a second time.
 * @template T
 * @param {() => Promise<T>} load an `import()`, which a browser tries anew each time
 * @returns {Promise<T>}
 */
export async function loaded(load) {
  for (let turn = 1; ; turn++) {
    try {
      return await load();
    } catch (error) {
      if (!/module/iu.test(String(error)) || turn === PART_TURNS) throw error; // as each browser says that one did not come
      await pause(PART_PAUSE_MS);
    }
  }
}

/** @param {Response} response */
const isJson = (response) => (response.headers.get("content-type") ?? "").includes("json");

/** An answer that has come to its end: one that breaks off is asked for again. @param {Response} response */
const whole = async (response) => (isJson(response) && response.status !== NO_CONTENT ? new Response(await response.text(), response) : response);

/** @param {Response} response */
async function problemOf(response) {
  const fallback = { type: "about:blank", title: response.statusText, status: response.status };
  if (!isJson(response)) {
    return new Problem({ ...fallback, detail: t("problem.unreadable", { status: response.status }) });
  }
  return new Problem({ ...fallback, ...(await response.json()) });
}

/** When this page was last about to be left: what it asked before must not turn the way somebody goes. */
let leaving_ms = -Infinity;
window.addEventListener("beforeunload", () => (leaving_ms = performance.now()));

/** The login is over, or there was none: the login page leads back to here. */
export function toLogin() {
  if (performance.now() - leaving_ms < LEAVING_MS) return;
  const { pathname, search, hash } = window.location;
  window.location.assign(`/login?ended=1&next=${encodeURIComponent(pathname + search + hash)}`);
}

/** Whether somebody is logged in now: a request may have been sent before that, and refused. */
async function isLoggedIn() {
  const answer = await fetch(`${ROOT}/me`, { cache: "no-store" });
  return answer.ok && (await answer.json()).role !== null;
}

/**
 * Ask, and ask again while the server cannot be reached; a POST carries its key, so that it counts once.
 * @param {string} path
 * @param {RequestInit} [init]
 * @param {string} [root] what the path is under
 * @returns {Promise<Response>}
 */
export async function request(path, init = {}, root = ROOT) {
  const headers = new Headers(init.headers);
  headers.set("Accept-Language", language);
  if (init.method === "POST") headers.set("Idempotency-Key", idempotencyKey());
  let wasRefused = false;
  for (const wait of [...PATIENCE_MS, 0]) {
    try {
      const response = await whole(await fetch(root + path, { ...init, headers }));
      linked(false);
      if (response.ok) return response;
      const rest_s = Number(response.headers.get("Retry-After") ?? 1);
      if (response.status === 429 && path !== LOGIN && wait && rest_s <= LONGEST_WAIT_S) {
        await pause(1000 * rest_s);
        continue;
      }
      if (response.status === 401 && path !== LOGIN) {
        if (wait && !wasRefused && (wasRefused = await isLoggedIn())) continue;
        toLogin();
      }
      throw await problemOf(response);
    } catch (error) {
      if (error instanceof Problem) throw error;
      linked(true);
      if (wait === 0) break;
      await pause(wait);
    }
  }
  throw unreachable();
}

/** What is thrown where the server does not answer. */
export function unreachable() {
  return new Problem({ type: "about:blank", title: t("problem.unreachable_title"), status: 0, detail: t("problem.unreachable") });
}

/**
 * Send a large file; `progress` hears which share of it has gone out. fetch cannot tell that, so this is the older way.
 * @param {string} path
 * @param {File} file
 * @param {string} type
 * @param {(share: number) => void} progress
 * @returns {Promise<any>}
 */
export async function sendFile(path, file, type, progress) {
  const key = idempotencyKey();
  for (const wait of PATIENCE_MS) {
    try {
      return await sendOnce(path, file, type, key, progress);
    } catch (error) {
      if (!(error instanceof Problem) || error.status !== 0) throw error;
      linked(true);
      await pause(wait);
    }
  }
  throw unreachable();
}

/** @param {string} path @param {File} file @param {string} type @param {string} key @param {(share: number) => void} progress @returns {Promise<any>} */
function sendOnce(path, file, type, key, progress) {
  return new Promise((resolve, reject) => {
    const sending = new XMLHttpRequest();
    sending.open("POST", ROOT + path);
    sending.setRequestHeader("Content-Type", type);
    sending.setRequestHeader("Idempotency-Key", key);
    sending.setRequestHeader("Accept-Language", language);
    sending.upload.onprogress = ({ loaded, total }) => progress(total ? loaded / total : 0);
    sending.onerror = () => reject(unreachable());
    sending.onload = () => {
      linked(false);
      const answer = new Response(sending.response || null, { status: sending.status, headers: { "content-type": sending.getResponseHeader("content-type") ?? "" } });
      if (answer.ok) resolve(answer.json());
      else void problemOf(answer).then(reject);
    };
    sending.send(file);
  });
}

/**
 * @param {string} method
 * @param {unknown} [body]
 * @returns {RequestInit}
 */
export function json(method, body) {
  if (body === undefined) return { method };
  return { method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
}

/** @param {number | undefined} revision @param {RequestInit} init @returns {RequestInit} */
export function madeAgainst(revision, init) {
  return revision === undefined ? init : { ...init, headers: { ...init.headers, "If-Match": `"${revision}"` } };
}

/**
 * @template T
 * @param {string} path
 * @returns {Promise<T>}
 */
export async function get(path) {
  return (await request(path)).json();
}

/**
 * All pages of a list.
 * @template T
 * @param {string} path
 * @returns {Promise<T[]>}
 */
export async function all(path) {
  /** @type {T[]} */
  const items = [];
  let cursor = "";
  do {
    const glue = path.includes("?") ? "&" : "?";
    /** @type {Page<T>} */
    const page = await get(cursor ? `${path}${glue}cursor=${encodeURIComponent(cursor)}` : path);
    items.push(...page.items);
    cursor = page.next ?? "";
  } while (cursor);
  return items;
}
