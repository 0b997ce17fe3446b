// The one file that speaks HTTP. Types come from the server's OpenAPI document (api-types.d.ts).

/** @import {Capture, CaptureOut, Guide, Job, Page, ParsedPose, ProblemBody, Results, SessionBody, SessionOut, SessionSummary, ToolFrame} from "./model.js" */

const ROOT = "/api/v1";
const PATIENCE_MS = [400, 1200, 3000];

/** A request that the server refused, or that never reached it; `message` says what to do. */
export class Problem extends Error {
  /** @param {ProblemBody} body */
  constructor(body) {
    super(body.detail ?? body.title);
    this.name = "Problem";
    this.body = body;
  }

  get status() {
    return this.body.status;
  }
}

/** A key that lets the server recognise the same request sent twice. Works without a secure context, too. */
function idempotencyKey() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** @param {number} milliseconds */
const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

/** @param {Response} response */
async function problemOf(response) {
  const fallback = { type: "about:blank", title: response.statusText, status: response.status };
  if (!(response.headers.get("content-type") ?? "").includes("json")) {
    return new Problem({ ...fallback, detail: `The server answered ${response.status}. Try again; if it stays, look into the server's log.` });
  }
  return new Problem({ ...fallback, ...(await response.json()) });
}

/**
 * Ask, and ask again while the server cannot be reached; a POST carries its key, so that it counts once.
 * @param {string} path
 * @param {RequestInit} [init]
 * @returns {Promise<Response>}
 */
async function request(path, init = {}) {
  const headers = new Headers(init.headers);
  if (init.method === "POST") headers.set("Idempotency-Key", idempotencyKey());
  for (const wait of [...PATIENCE_MS, 0]) {
    try {
      const response = await fetch(ROOT + path, { ...init, headers });
      if (response.ok) return response;
      throw await problemOf(response);
    } catch (error) {
      if (error instanceof Problem) throw error;
      if (wait === 0) break;
      await pause(wait);
    }
  }
  throw new Problem({
    type: "about:blank", title: "No connection", status: 0,
    detail: "The server cannot be reached. Nothing is lost; start it again or check the network, then repeat the last step.",
  });
}

/**
 * @param {string} method
 * @param {unknown} [body]
 * @returns {RequestInit}
 */
function json(method, body) {
  if (body === undefined) return { method };
  return { method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
}

/**
 * @template T
 * @param {string} path
 * @returns {Promise<T>}
 */
async function get(path) {
  return (await request(path)).json();
}

/**
 * All pages of a list.
 * @template T
 * @param {string} path
 * @returns {Promise<T[]>}
 */
async function all(path) {
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

/** @param {string} id */
const session = (id) => `/sessions/${encodeURIComponent(id)}`;

/**
 * @param {string} id
 * @param {string} captureId
 */
const capture = (id, captureId) => `${session(id)}/captures/${encodeURIComponent(captureId)}`;

export const api = {
  /** @returns {Promise<SessionSummary[]>} */
  sessions: () => all("/sessions"),

  /** @param {SessionBody} body @returns {Promise<SessionOut>} */
  createSession: async (body) => (await request("/sessions", json("POST", body))).json(),

  /** @param {string} id @returns {Promise<SessionOut>} */
  session: (id) => get(session(id)),

  /** @param {string} id @param {Record<string, unknown>} change @returns {Promise<SessionOut>} */
  changeSession: async (id, change) => (await request(session(id), json("PATCH", change))).json(),

  /** @param {string} id */
  removeSession: async (id) => void (await request(session(id), json("DELETE"))),

  /** @param {string} id @returns {Promise<Guide>} */
  guide: (id) => get(`${session(id)}/guide`),

  /** @param {string} id @returns {Promise<Results>} */
  results: (id) => get(`${session(id)}/results`),

  /** @param {string} id @returns {Promise<CaptureOut[]>} */
  captures: (id) => all(`${session(id)}/captures`),

  /** @param {string} id @param {string} captureId @returns {Promise<CaptureOut>} */
  capture: (id, captureId) => get(capture(id, captureId)),

  /**
   * @param {string} id
   * @param {Capture} record
   * @param {File[]} files
   * @returns {Promise<CaptureOut>}
   */
  addCapture: async (id, record, files) => {
    const form = new FormData();
    form.append("record", JSON.stringify(record));
    files.forEach((file, index) => form.append("files", file, record.files?.[index] ?? file.name));
    return (await request(`${session(id)}/captures`, { method: "POST", body: form })).json();
  },

  /** @param {string} id @param {string} captureId @param {Record<string, unknown>} change @returns {Promise<CaptureOut>} */
  changeCapture: async (id, captureId, change) => (await request(capture(id, captureId), json("PATCH", change))).json(),

  /** @param {string} id @param {string} captureId */
  removeCapture: async (id, captureId) => void (await request(capture(id, captureId), json("DELETE"))),

  /** @param {string} id @param {string} captureId @param {string} name @returns {Promise<File>} */
  captureFile: async (id, captureId, name) => {
    const short = name.split("/").at(-1) ?? name;
    const response = await request(`${capture(id, captureId)}/files/${encodeURIComponent(short)}`);
    return new File([await response.blob()], short);
  },

  /** One of `step` where the simulated cell has some left. @param {string} id @param {string} [step] @returns {Promise<CaptureOut>} */
  captureSimulated: async (id, step) => (await request(`${session(id)}/sources/simulated/capture${step ? `?step=${encodeURIComponent(step)}` : ""}`, json("POST"))).json(),

  /** @param {string} id @param {string} text @returns {Promise<ParsedPose[]>} */
  readPoseLines: async (id, text) => (await (await request(`${session(id)}/pose-lines`, json("POST", { text }))).json()).items,

  /** @param {string} id @param {string} stage @returns {Promise<Job>} */
  solve: async (id, stage) => (await request(`${session(id)}/solve/${stage}`, json("POST"))).json(),

  /** @param {string} jobId @returns {Promise<Job>} */
  job: (jobId) => get(`/jobs/${encodeURIComponent(jobId)}`),

  /** @param {string} jobId */
  cancelJob: async (jobId) => void (await request(`/jobs/${encodeURIComponent(jobId)}/cancel`, json("POST"))),

  /** The tool frame in every convention, with its uncertainty. @param {string} id @returns {Promise<ToolFrame>} */
  toolFrame: (id) => get(`${session(id)}/exports/json`),

  /** @param {string} id @param {string} format */
  exportAddress: (id, format) => `${ROOT}${session(id)}/exports/${encodeURIComponent(format)}`,

  /** @param {string} id @param {string} captureId @param {string} name */
  fileAddress: (id, captureId, name) => `${ROOT}${capture(id, captureId)}/files/${encodeURIComponent(name.split("/").at(-1) ?? name)}`,

  /** @param {string} id */
  eventsAddress: (id) => `${ROOT}${session(id)}/events`,
};
