// The two things one does here, again and again: capture and solve. The primary button says what will happen.

import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { h, putChildren } from "../dom.js";
import { allowed, may } from "../state/me.js";
import { sound } from "../shop.js";
import { maybe, said, t } from "../texts.js";
import { did } from "../state/undo.js";
import { nextStep } from "../state/next-step.js";
import { StateElement } from "../components/base.js";
import { decisionOf } from "./exclude.js";
import { keep } from "./removed-captures.js";
import { isToImprove } from "../state/standing.js";
import { ownName, stepName } from "./rail.js";
import { mendable, remedies } from "../result/remedy.js";
import { attempt, notify, say } from "../components/toasts.js";

/** @import {FolderWatchElement} from "./folder-watch.js" */
/** @import {IntakeElement} from "./intake.js" */
/** @import {Job, RootCause} from "../state/model.js" */

/** A job ended because its server, its cluster or its worker did. */
const INTERRUPTED = 503;
/** Two rows of actions are higher. */
const ONE_ROW_PX = 60;

export class ActionsElement extends StateElement {
  /** @type {IntakeElement | null} */ intake = null;
  /** @type {FolderWatchElement | null} */ watch = null;
  devices = () => {};
  #captureWords = h("span", {}, t("actions.capture"));
  #solveWords = h("span", {}, t("actions.solve"));
  #capture = h("button", { type: "button", class: "capture", needs: "capture", "aria-keyshortcuts": "Space", onclick: () => void this.capture() }, this.#captureWords, h("kbd", { "aria-hidden": "true" }, t("key.space")));
  #solve = h("button", { type: "button", class: "solve", needs: "capture", "aria-keyshortcuts": "S", onclick: () => void this.solve() }, this.#solveWords, h("kbd", { "aria-hidden": "true" }, "S"));
  #look = h("button", { type: "button", class: "primary", onclick: () => this.state.show("result") }, t("actions.look"));
  #mend = h("button", { type: "button", class: "primary", needs: "capture", onclick: () => this.state.show("measure") }, t("actions.mend"));
  #onWords = h("span", {});
  #on = h("button", { type: "button", class: "primary", onclick: () => this.state.open(this.#next) }, this.#onWords);
  #remedies = h("span", { class: "remedies row" });
  #judged = "";
  #progress = h("div", { class: "job", hidden: true });
  #files = wayIn(t("actions.files"), () => this.intake?.chooseFiles());
  #folder = wayIn(t("actions.folder"), () => this.intake?.chooseFolder());
  #watch = wayIn(t("actions.watch"), () => void this.watch?.open());
  #others = h("span", { onclick: () => this.#fold(true) }, this.#files, this.#folder, wayIn(t("actions.poses"), () => this.intake?.open()), this.#watch, wayIn(t("actions.devices"), () => this.devices()));
  #waysIn = h("details", { class: "ways-in", open: true }, h("summary", { class: "button plain wide" }, t("actions.ways")), this.#others);
  #row = h("div", { class: "row" }, this.#remedies, this.#mend, this.#on, this.#look, this.#capture, this.#solve, this.#waysIn);
  /** @type {string | null} */ #next = null;
  #capturing = false;
  /** A capture that was taken, until the page shows it. */ #awaited = "";
  #asking = false;
  #followed = "";
  #again = "";
  /** Whether the server was away since the solve was begun. */ #wasAway = false;
  /** Whether what is wrong with a failed solve is looked for, which may take long. */ #searching = false;
  /** Takes back what was said of a failed solve. */ #takeBack = () => {};
  /** The captures that it had. */ #failedOf = "";

  parts = /** @type {const} */ (["session", "guide", "job", "captures", "results", "step", "view", "live"]);

  build() {
    this.intake?.addEventListener("solve", () => void this.solve());
    // What sticks above these actions must know how high they are; told to it alone: all below take long to style anew.
    new ResizeObserver(() => {
      requestAnimationFrame(() => this.#fold()); // it changes what is observed
      this.intake?.style.setProperty("--actions-height", `${this.offsetHeight}px`);
    }).observe(this);
    this.append(this.#row, this.#progress);
  }

  update() {
    const { session, job, captures, now, view } = this.state;
    this.#wasAway ||= this.state.live !== "live";
    if (this.#failedOf !== idsOf(captures)) this.#takeBack(); // other captures may be solved
    const simulated = session?.simulated === true;
    const ready = now?.action === "solve";
    const solved = now?.action === "review";
    // What is not accepted is mended by captures; where all is well, the way leads on.
    const result = this.state.resultOf(this.state.step);
    const mends = (solved || !now) && result !== null && !result.stale && (result.verdict === "fail" || isToImprove(result));
    this.#next = nextStep(this.state);
    const onward = this.#next !== null && !mends;
    this.#onWords.textContent = t("guide.go_on", { step: stepName(this.state, this.#next ?? "") });
    this.#on.hidden = this.#next === null;
    this.#on.className = mends ? "plain wide" : "primary";
    if (captures.some(({ id }) => id === this.#awaited)) this.#awaited = "";
    const busy = this.#capturing || this.#awaited !== "";
    this.#capture.setAttribute("aria-disabled", String(busy || !may("capture")));
    const own = ownName(this.state, this.#stage);
    this.#captureWords.textContent = busy ? t("actions.capturing") : this.#step && ownName(this.state, this.#step) ? t("actions.capture_tcp") : maybe(`actions.capture_${this.#step ?? ""}`, t("actions.capture"));
    this.#solveWords.textContent = own ? t("actions.solve_own", { what: own }) : maybe(`actions.solve_${this.#stage}`, t("actions.solve"));
    const status = this.state.guide?.steps.find(({ step }) => step === this.state.step)?.status ?? (this.state.now ? "working" : "");
    const isAside = status === "not-needed" || status === "known"; // nothing is captured for such a step, nor solved
    this.#capture.hidden = !simulated || status === "" || isAside;
    this.#watch.hidden = simulated;
    this.#folder.hidden = simulated || captures.length > 0; // a folder brings a cell of its own; it may be dropped here all the same
    this.#look.hidden = !solved || view === "result";
    this.#look.classList.toggle("primary", !onward && !mends);
    this.#solve.hidden = !this.state.guide || solved || (isAside && !result && !ready) || (!simulated && captures.length === 0);
    const idle = solved || (!now && status === "done"); // nothing more is asked for in this step
    this.#capture.classList.toggle("primary", !ready && (!idle || mends) && !onward);
    this.#solve.classList.toggle("primary", ready);
    this.#mend.classList.add("primary");
    this.#mend.hidden = !mends || simulated || view !== "result";
    // Nothing is the main thing before the guide has said what comes next.
    this.#files.className = simulated || ready || (solved && !mends) || onward || !this.state.guide ? "plain wide" : "primary";
    this.#solve.setAttribute("aria-disabled", String(captures.length === 0 || this.state.adding || this.#isSolving || !may("capture")));
    this.#showJob();
    this.#offerRemedies();
    this.#fold();
    if (job && job.id === this.#followed) this.#ended();
  }

  /** One bar of actions: where they take two rows, the other ways in, then what is not the main thing, are behind a word. @param {boolean} [done] whether one of them was taken */
  #fold(done = false) {
    const ways = this.#waysIn, isResult = this.state.view === "result"; // new captures belong to measuring; files may be dropped all the same
    if (ways.matches(".folded[open]") && !done) return; // somebody chooses
    const isLong = () => this.#row.offsetHeight > ONE_ROW_PX;
    const isMain = (/** @type {HTMLElement} */ one) => one.classList.contains("primary");
    ways.hidden = isResult;
    ways.classList.toggle("no-ways", isResult);
    ways.classList.remove("folded");
    ways.open = true;
    /** @type {HTMLElement} */ let next = ways;
    if (isMain(this.#files) && ways.checkVisibility()) next = this.#into(this.#row, this.#files, ways);
    else this.#into(this.#others, this.#files, this.#others.firstChild);
    for (const one of [this.#solve, this.#capture, this.#look, this.#on]) next = this.#into(this.#row, one, next);
    if (!isLong()) return;
    ways.hidden = ways.open = false;
    ways.classList.add("folded");
    for (const one of [this.#on, this.#look, this.#solve, this.#capture]) if (isLong() && !one.hidden && !isMain(one)) this.#others.prepend(one);
  }

  /** What is there already keeps the focus. @param {HTMLElement} place @param {HTMLElement} one @param {Node | null} next */
  #into(place, one, next) {
    if (one.parentElement !== place) place.insertBefore(one, next);
    return one;
  }

  /** What mends a failed result stands first, and nothing else is the main thing then. */
  #offerRemedies() {
    const { state } = this;
    const stage = state.stageOf(state.step);
    const result = state.results[stage];
    const judged = `${stage} ${result?.inputs_sha256} ${result?.stale}`;
    if (judged === this.#judged) return this.#quiet();
    this.#judged = judged;
    this.#offer(stage, result ? mendable(result) : []);
  }

  /** @param {string} stage @param {readonly RootCause[]} causes */
  #offer(stage, causes) {
    putChildren(this.#remedies, remedies(this.state, stage, causes).map(({ name, words, mend }, index) =>
      h("button", { type: "button", class: index ? "plain wide" : "primary", needs: "capture", title: words, onclick: () => void this.#apply(mend) }, name)));
    this.#quiet();
  }

  /** Once is enough: what mends goes as it is applied, and comes back where that failed. @param {() => Promise<unknown>} mend */
  async #apply(mend) {
    const offered = [...this.#remedies.children];
    this.#remedies.replaceChildren();
    if (!await mend()) this.#remedies.replaceChildren(...offered);
  }

  #quiet() {
    if (!this.#remedies.firstChild) return;
    for (const button of [this.#mend, this.#on, this.#look, this.#capture, this.#solve]) button.classList.remove("primary");
    this.#files.className = "plain wide";
  }

  /** The step that captures are taken for now; merging takes none of its own. */
  get #step() {
    const step = this.state.now?.step ?? this.state.step;
    return step === this.state.stageOf(step) ? this.state.stages.find(({ name }) => name === step)?.steps?.[0] ?? step : step;
  }

  /** The stage that is solved now. */
  get #stage() {
    return this.state.now?.stage ?? this.state.stageOf(this.state.step);
  }

  /** From the click until guide and results know how it ended. */
  get #isSolving() {
    return this.#asking || this.state.working || this.state.settling;
  }

  #showJob() {
    const { job, working, settling } = this.state;
    this.#progress.hidden = !working && !settling && !this.#searching;
    if (!working && this.#searching) putChildren(this.#progress, [h("progress", { "aria-label": t("actions.searching") }), h("span", { class: "small", role: "status" }, t("actions.searching"))]);
    if (!job || !working) return;
    const cancel = () => attempt(() => api.cancelJob(job.id));
    const words = maybe(`actions.solving_${job.stage}`, t("actions.solving"));
    putChildren(this.#progress, [
      h("progress", { max: 1, value: job.progress, "aria-label": words }),
      h("span", { class: "small" }, said(job.message ?? "") || words),
      h("button", { type: "button", needs: "capture", onclick: cancel }, t("cancel")),
    ]);
  }

  /** The job that this page started has ended: say how. */
  #ended() {
    const { job } = this.state;
    if (!job || this.state.working) return;
    this.#followed = "";
    if (job.status === "done") {
      this.#again = "";
      this.state.open(job.stage, "result");
      sound(this.state.results[job.stage]?.verdict ?? "pass");
      say(maybe(`actions.solved_${job.stage}`, t("actions.solved")));
    } else if (job.status === "failed") void this.#failed(job);
    else notify(maybe(`actions.cancelled_${job.stage}`, t("actions.cancelled")));
  }

  /** Say why nothing could be solved, and offer what would mend it. @param {Job} job */
  async #failed({ stage, error }) {
    if (error?.status === INTERRUPTED && this.#wasAway && stage !== this.#again) {
      this.#again = stage; // once: what ends the server each time is not asked for for ever
      notify(t("actions.again"));
      return this.#start(stage);
    }
    this.#failedOf = idsOf(this.state.captures);
    this.#takeBack = notify(error ? new Problem(error).message : t("actions.failed"), { bad: true });
    this.#searching = true;
    this.#showJob();
    const { items } = await api.causes(this.state.id).catch(() => ({ items: [] }));
    this.#searching = false;
    this.#showJob();
    if (!this.state.working) this.#offer(stage, items);
  }

  /** Let the simulated cell take its next capture. */
  async capture() {
    if (this.#capturing || this.#awaited || this.#capture.hidden || !allowed("capture")) return;
    this.#capturing = true;
    this.state.show("measure");
    this.update();
    await attempt(async () => {
      const { id } = this.state;
      const add = (/** @type {string} */ why) => api.captureSimulated(id, this.#step, why);
      const capture = decisionOf(this.state) ? await (await import("./add-reason.js")).addedWithReason(this.state, add) : await add("");
      if (!capture) return;
      if (!this.state.captures.some((one) => one.id === capture.id)) this.#awaited = capture.id;
      this.state.hurry();
      const kept = keep(id, [capture]);
      did(t("captures.added", { captures: capture.id }), kept.remove, { redo: kept.restore });
      const { verdict, reason } = capture.measured;
      sound(verdict);
      say(t(`actions.captured_${verdict}`, { capture: capture.id, reason: said(reason ?? "") }));
      if (this.state.selected) this.state.select(null);
    });
    this.#capturing = false;
    this.update();
  }

  /** Do what the main button says: the way on is one key, however long the page above it. */
  goOn() {
    const main = [...this.querySelectorAll("button.primary")].find((one) => one.checkVisibility() && one.getAttribute("aria-disabled") !== "true");
    if (main instanceof HTMLElement) main.click();
  }

  async solve() {
    if (this.#isSolving || this.state.adding || (this.#solve.hidden && !this.state.now) || !this.state.captures.length || !allowed("capture")) return;
    await this.#start(this.#stage);
  }

  /** One job a click, however long its start takes. @param {string} stage */
  async #start(stage) {
    this.#asking = true;
    this.#wasAway = false;
    this.#takeBack();
    this.#solve.setAttribute("aria-disabled", "true");
    await attempt(async () => {
      const job = await api.solve(this.state.id, stage);
      this.#followed = job.id;
      this.state.follows(job);
    });
    this.#asking = false;
    this.update();
  }
}

/** @param {readonly {id: string}[]} captures */
const idsOf = (captures) => captures.map(({ id }) => id).join();

/** @param {string} text @param {() => void} action */
function wayIn(text, action) {
  return h("button", { type: "button", class: "plain wide", "data-way": "", needs: "capture", onclick: action }, text);
}

customElements.define("sc-actions", ActionsElement);
