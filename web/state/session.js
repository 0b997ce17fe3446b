// What the page knows of one session. The server is the truth; this follows it, whoever changes it.

import { api } from "./api.js";
import { Problem } from "./http.js";
import { follow } from "./events.js";
import { stages } from "./registries.js";

/** @import {CaptureOut, Guide, GuideNow, Job, Results, SessionOut, StageInfo} from "./model.js" */
/** @import {Liveness} from "./events.js" */
/** @typedef {"session" | "captures" | "guide" | "results" | "job" | "live" | "selection" | "view" | "step" | "problem" | "place" | "devices" | "release" | "surface" | "scene"} Part */

const EVENTS = ["capture", "result", "job", "session", "device", "release"];
const WHOLE = /** @type {const} */ (["session", "captures", "guide", "results"]);
const GATHER_MS = 40;
// After a load so many times its duration passes before events cause the next: a page never burdens a busy service.
const REST = 5;
const LONGEST_REST_MS = 1000;

export class SessionState extends EventTarget {
  /** @type {SessionOut | null} */ session = null;
  /** @type {CaptureOut[]} */ captures = [];
  /** @type {Guide | null} */ guide = null;
  /** @type {Results} */ results = {};
  /** @type {Job | null} */ job = null;
  /** @type {Liveness} */ live = "connecting";
  /** Whether a solve has ended of which guide and results do not know yet. */ settling = false;
  /** Whether captures are being sent: a solve would not have them all. */ adding = false;
  /** When the page last had the server's word. */ liveSince = new Date();
  /** @type {string | null} */ selected = null;
  /** The point of the merged surface that was last clicked in the scene. @type {readonly number[] | null} */ surface = null;
  /** @type {"measure" | "result"} */ view = "measure";
  /** The step that was chosen; null follows the guide. @type {string | null} */ chosen = null;
  /** What the registry says of the stages. @type {StageInfo[]} */ stages = [];
  /** @type {Problem | null} */ problem = null;
  /** @type {Set<Part>} */ #stale = new Set();
  /** @type {Set<string>} */ #staleCaptures = new Set();
  #asking = false;
  /** Removed while an answer that still has them may be under way. @type {Set<string>} */ #gone = new Set();
  #timer = 0;
  #restsUntilMs = 0;
  /** @type {Promise<void> | null} */ #running = null;
  /** @type {(() => void) | null} */ #stop = null;

  /** @param {string} id */
  constructor(id) {
    super();
    this.id = id;
  }

  /** Load everything, then follow. */
  async start() {
    await this.reload();
    if (this.problem?.status !== 404) this.#follow();
  }

  /** Hear what changes, as soon as there is something to see. */
  #follow() {
    this.#stop ??= follow(
      api.eventsAddress(this.id), EVENTS,
      (name, data) => this.#heard(name, /** @type {Record<string, any>} */ (data)),
      (live, again) => {
        this.live = live;
        this.liveSince = new Date();
        this.tell("live");
        if (live !== "live") return;
        void this.#askForJob();
        if (again || !this.session) void this.reload();
      },
      () => void this.#askWhetherThere(),
    );
  }

  /** Nobody tells of the removal of a session whose events could not be followed when it was removed. */
  async #askWhetherThere() {
    if (this.#asking) return;
    this.#asking = true;
    const found = await api.session(this.id).catch((/** @type {unknown} */ error) => error);
    this.#asking = false;
    if (!(found instanceof Problem) || found.status !== 404) return;
    this.stop();
    await this.reload();
  }

  stop() {
    this.#stop?.();
    window.clearTimeout(this.#timer);
  }

  async reload() {
    for (const part of WHOLE) this.#stale.add(part);
    this.#gone.clear();
    while (this.#stale.size) await this.#catchUp();
  }

  /** One load at a time, so that an answer asked for earlier never comes last; what changes meanwhile is loaded later. */
  #catchUp() {
    this.#running ??= this.#loadStale().finally(() => { this.#running = null; });
    return this.#running;
  }

  async #loadStale() {
    const stale = this.#stale;
    this.#stale = new Set();
    const startMs = performance.now();
    await this.#load(stale);
    const nowMs = performance.now();
    this.#restsUntilMs = nowMs + Math.min(REST * (nowMs - startMs), LONGEST_REST_MS);
    if (this.#stale.size) this.#later();
  }

  /** What runs, and how it ended, may have been told while nobody listened. */
  async #askForJob() {
    const { job } = this;
    const now = await (job && this.working ? api.job(job.id).catch(gone) : api.newestJob(this.id)).catch(() => job);
    if (this.job !== job || now?.id === job?.id && now?.status === job?.status) return;
    this.job = now;
    this.tell("job");
  }

  /** The capture that the page shows: the one picked, otherwise the newest. */
  get shown() {
    return this.captures.find((capture) => capture.id === this.selected) ?? this.stepCaptures.at(-1) ?? null;
  }

  get working() {
    return this.job !== null && (this.job.status === "queued" || this.job.status === "running");
  }

  /** How a stage stands that has no result to show. @param {string} stage @returns {"solving" | "loading" | "none"} */
  without(stage) {
    if (!this.session) return "loading";
    if (!this.job || (this.job.stage !== stage && this.job.stage !== "all")) return "none";
    return this.working ? "solving" : this.job.status === "done" && this.job.stage === stage ? "loading" : "none";
  }

  /** @param {string | null} id */
  select(id) {
    this.selected = this.selected === id ? null : id;
    this.tell("selection");
  }

  /** @param {readonly number[]} point */
  touch(point) {
    this.surface = point;
    this.tell("surface");
  }

  /** @param {"measure" | "result"} view */
  show(view) {
    if (this.view === view) return;
    this.view = view;
    this.tell("view");
  }

  /** Open a step: its guide, captures, result and scene; null follows the guide. @param {string | null} step @param {"measure" | "result"} [view] */
  open(step, view = step && this.resultOf(step) ? "result" : "measure") {
    this.chosen = step;
    this.view = view;
    this.tell("step", "view");
  }

  /** The step that is open. */
  get step() {
    return this.chosen ?? this.guide?.current.step ?? "";
  }

  /** All steps that can be opened: the guide's, and behind them stages with results of their own. */
  get steps() {
    /** @type {string[]} */
    const guided = (this.guide?.steps ?? []).map(({ step }) => step);
    const solved = this.stages.map(({ name }) => name).filter((name) => (this.results[name] || this.guide?.current.stage === name || this.chosen === name) && !guided.includes(name));
    // Each stands where it is solved: behind the step of the stage before it.
    const order = this.stages.map(({ name }) => name);
    const place = (/** @type {string} */ step) => order.indexOf(this.stageOf(step));
    return [...guided, ...solved].sort((a, b) => place(a) - place(b));
  }

  /** The steps that captures are taken for. */
  get captureSteps() {
    return [...new Set(this.stages.flatMap(({ steps = [] }) => steps))];
  }

  /** What a step's captures show: the board, the sphere, the sphere on the table, or an object. @param {string} step */
  shows(step) {
    const own = this.stages.flatMap((stage) => [stage.step, ...stage.further_steps]);
    return own.find((one) => one?.name === step)?.shows ?? "sphere";
  }

  /** Whether a step's captures show the board, for which no robot is needed. @param {string} step */
  showsBoard(step) {
    return this.shows(step) === "board";
  }

  /** The stage that a step belongs to. @param {string} step */
  stageOf(step) {
    return this.stages.find(({ name, guided, further_steps: further }) => name === step || guided.includes(step) || further.some((one) => one.name === step))?.name ?? step;
  }

  /** @param {string} step */
  resultOf(step) {
    return this.results[this.stageOf(step)] ?? null;
  }

  /** What the guide says of the step that is open; null where it says nothing of it. @returns {GuideNow | null} */
  get now() {
    const { guide, step } = this;
    if (!guide) return null;
    if (guide.current.step === step || guide.current.stage === step) return guide.current;
    return /** @type {{ now?: GuideNow } | undefined} */ (guide.steps.find((one) => one.step === step))?.now ?? null;
  }

  /** The captures of the step that is open. */
  get stepCaptures() {
    const { step } = this;
    const taken = this.stages.find(({ name }) => name === this.stageOf(step))?.steps ?? [step];
    const own = this.captures.filter((capture) => capture.step === step);
    return own.length ? own : this.captures.filter((capture) => taken.includes(capture.step));
  }

  /** What was done here is shown at once, without the rest between two loads. */
  hurry() {
    this.#restsUntilMs = 0;
    if (this.#stale.size) this.#later();
  }

  /** Captures are being sent from here, or have been. @param {boolean} adding */
  adds(adding) {
    this.adding = adding;
    this.tell("captures");
  }

  /** A job that was started here; its events may have come before the answer that names it. @param {Job} job */
  follows(job) {
    if (this.job?.id !== job.id) this.job = job;
    this.tell("job");
  }

  /**
   * Call `listener` now and whenever one of `parts` changes.
   * @param {readonly Part[]} parts
   * @param {(changed: ReadonlySet<Part>) => void} listener
   * @returns {() => void} stop
   */
  watch(parts, listener) {
    /** @param {Event} event */
    const heard = (event) => {
      const changed = /** @type {CustomEvent<Set<Part>>} */ (event).detail;
      if (parts.some((part) => changed.has(part))) listener(changed);
    };
    this.addEventListener("change", heard);
    listener(new Set(parts));
    return () => this.removeEventListener("change", heard);
  }

  /** Tell who watches that these parts have changed. @param {...Part} parts */
  tell(...parts) {
    this.dispatchEvent(new CustomEvent("change", { detail: new Set(parts) }));
  }

  /**
   * @param {string} name
   * @param {Record<string, any>} data
   */
  #heard(name, data) {
    if (name === "job") {
      this.job = /** @type {Job} */ (data);
      // Until guide and results that know of it are there, what they say is of before.
      if (this.job.status === "done") {
        this.settling = true;
        this.#later("guide", "results");
      }
      this.tell("job");
      return;
    }
    if (name === "device") return this.tell("devices");
    if (name === "release") return this.tell("release");
    if (name === "capture") {
      if (data.action === "removed") this.#drop(data.capture);
      else if (data.count) this.#later("captures");
      else {
        this.#gone.delete(data.capture);
        // Many that came at once are told as one, by the last one's name.
        if (data.count > 1) this.#stale.add("captures");
        else this.#staleCaptures.add(data.capture);
      }
      this.#later("guide", "results");
    } else if (name === "result") this.#later("guide", "results");
    else this.#later("session", "guide", "results");
  }

  /** @param {string} id */
  #drop(id) {
    this.#gone.add(id);
    this.#staleCaptures.delete(id);
    this.captures = this.captures.filter((capture) => capture.id !== id);
    if (this.selected === id) this.selected = null;
    this.tell("captures", "selection");
  }

  /** @param {...Part} parts */
  #later(...parts) {
    for (const part of parts) this.#stale.add(part);
    window.clearTimeout(this.#timer);
    const waitMs = Math.max(GATHER_MS, this.#restsUntilMs - performance.now());
    this.#timer = window.setTimeout(() => void this.#catchUp(), waitMs);
  }

  /** @param {Set<Part>} parts */
  async #load(parts) {
    const captures = parts.has("captures") ? api.captures(this.id) : this.#loadStaleCaptures();
    const asked = parts.has("guide") ? api.guide(this.id).catch((/** @type {unknown} */ error) => error) : this.guide;
    const first = !this.session;
    try {
      const [session, list, results] = await Promise.all([
        parts.has("session") ? api.session(this.id) : this.session,
        captures,
        parts.has("results") ? api.results(this.id) : this.results,
      ]);
      this.stages = await stages();
      const known = () => Object.assign(this, { session, captures: list.filter(({ id }) => !this.#gone.has(id)), results, problem: null });
      if (first) {
        // A busy server's guide may take a minute: nobody waits for it to see what is there.
        known();
        this.tell("session", "captures", "results", "problem");
        this.#follow();
      }
      const guide = await asked;
      if (guide instanceof Error) throw guide;
      if (parts.has("guide") && !this.#stale.has("guide")) this.settling = false;
      Object.assign(known(), { guide });
      this.tell(...parts, "captures", "problem");
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      this.problem = error;
      this.settling = false;
      if (error.status === 404) this.session = null;
      this.tell("problem", "session");
    }
  }

  /** @returns {Promise<CaptureOut[]>} */
  async #loadStaleCaptures() {
    const ids = [...this.#staleCaptures];
    this.#staleCaptures.clear();
    if (ids.length > 8) return api.captures(this.id);
    const fresh = await Promise.all(ids.map((id) => api.capture(this.id, id).catch(gone)));
    const list = [...this.captures];
    for (const capture of fresh) {
      if (!capture) continue;
      const place = list.findIndex((known) => known.id === capture.id);
      if (place >= 0) list[place] = capture;
      else list.push(capture);
    }
    return list;
  }
}

/**
 * What was removed in the meantime is no problem.
 * @param {unknown} error
 */
function gone(error) {
  if (error instanceof Problem && error.status === 404) return null;
  throw error;
}
