// The two things one does here, again and again: capture and solve. The primary button says what will happen.

import { api, Problem } from "../api.js";
import { h } from "../dom.js";
import { allowed, may } from "../me.js";
import { maybe, t } from "../texts.js";
import { did } from "../undo.js";
import { StateElement } from "./base.js";
import { attempt, notify, say } from "./toasts.js";

/** @import {FolderWatchElement} from "./folder-watch.js" */
/** @import {IntakeElement} from "./intake.js" */

export class ActionsElement extends StateElement {
  /** @type {IntakeElement | null} */ intake = null;
  /** @type {FolderWatchElement | null} */ watch = null;
  #captureWords = h("span", {}, t("actions.capture"));
  #solveWords = h("span", {}, t("actions.solve"));
  #capture = h("button", { type: "button", class: "capture", needs: "capture", "aria-keyshortcuts": "Space", onclick: () => void this.capture() }, this.#captureWords, h("kbd", { "aria-hidden": "true" }, t("key.space")));
  #solve = h("button", { type: "button", class: "solve", needs: "capture", "aria-keyshortcuts": "S", onclick: () => void this.solve() }, this.#solveWords, h("kbd", { "aria-hidden": "true" }, "S"));
  #look = h("button", { type: "button", class: "primary", onclick: () => this.state.show("result") }, t("actions.look"));
  #progress = h("div", { class: "job", hidden: true });
  #files = wayIn(t("actions.files"), () => this.intake?.chooseFiles());
  #folder = wayIn(t("actions.folder"), () => this.intake?.chooseFolder());
  #watch = wayIn(t("actions.watch"), () => void this.watch?.open());
  #capturing = false;
  #followed = "";

  get parts() {
    return /** @type {const} */ (["session", "guide", "job", "captures"]);
  }

  build() {
    this.append(
      h("div", { class: "row" }, this.#look, this.#capture, this.#solve,
        h("span", { class: "ways-in" },
          this.#files,
          this.#folder,
          wayIn(t("actions.poses"), () => this.intake?.open()),
          this.#watch)),
      this.#progress,
    );
  }

  update() {
    const { session, guide, job, captures } = this.state;
    const simulated = session?.simulated === true;
    const ready = guide?.current.action === "solve";
    this.#captureWords.textContent = maybe(`actions.capture_${captureStep(guide?.current.step) ?? ""}`, t("actions.capture"));
    this.#solveWords.textContent = maybe(`actions.solve_${guide?.current.stage ?? ""}`, t("actions.solve"));
    this.#capture.hidden = !simulated;
    this.#watch.hidden = simulated;
    this.#folder.hidden = simulated; // a folder brings a cell of its own; it may be dropped here all the same
    const solved = guide?.current.action === "review";
    this.#look.hidden = !solved;
    this.#solve.hidden = solved;
    this.#capture.classList.toggle("primary", !ready && !solved);
    this.#solve.classList.toggle("primary", ready);
    this.#files.className = simulated || ready || solved ? "plain wide" : "primary";
    this.#solve.setAttribute("aria-disabled", String(captures.length === 0 || this.state.working || !may("capture")));
    this.#showJob();
    if (job && job.id === this.#followed) this.#ended();
  }

  #showJob() {
    const { job, working } = this.state;
    this.#progress.hidden = !working;
    if (!job || !working) return;
    const cancel = () => attempt(() => api.cancelJob(job.id));
    const words = maybe(`actions.solving_${job.stage}`, t("actions.solving"));
    this.#progress.replaceChildren(
      h("progress", { max: 1, value: job.progress, "aria-label": words }),
      h("span", { class: "small" }, job.message || words),
      h("button", { type: "button", needs: "capture", onclick: cancel }, t("actions.cancel")),
    );
  }

  /** The job that this page started has ended: say how. */
  #ended() {
    const { job } = this.state;
    if (!job || this.state.working) return;
    this.#followed = "";
    if (job.status === "done") {
      this.state.show("result");
      say(maybe(`actions.solved_${job.stage}`, t("actions.solved")));
    } else if (job.status === "failed") notify(job.error ? new Problem(job.error).message : t("actions.failed"), { bad: true });
    else notify(maybe(`actions.cancelled_${job.stage}`, t("actions.cancelled")));
  }

  /** Let the simulated cell take its next capture. */
  async capture() {
    if (this.#capturing || this.#capture.hidden || !allowed("capture")) return;
    this.#capturing = true;
    this.#capture.setAttribute("aria-disabled", "true");
    this.state.show("measure");
    await attempt(async () => {
      const capture = await api.captureSimulated(this.state.id, captureStep(this.state.guide?.current.step));
      did(t("captures.added", { captures: capture.id }), () => api.removeCapture(this.state.id, capture.id));
      const { verdict, reason } = capture.measured;
      say(t(`actions.captured_${verdict}`, { capture: capture.id, reason: reason ?? "" }));
      if (this.state.selected) this.state.select(null);
    });
    this.#capture.removeAttribute("aria-disabled");
    this.#capturing = false;
  }

  async solve() {
    if (this.state.working || !this.state.captures.length || !allowed("capture")) return;
    await attempt(async () => {
      const job = await api.solve(this.state.id, this.state.guide?.current.stage ?? "tcp");
      this.#followed = job.id;
      this.state.follows(job);
    });
  }
}

/** The step that captures are taken for now; merging takes none. @param {string | undefined} step */
function captureStep(step) {
  return step === "merge" ? "scan" : step;
}

/** @param {string} text @param {() => void} action */
function wayIn(text, action) {
  return h("button", { type: "button", class: "plain wide", needs: "capture", onclick: action }, text);
}

customElements.define("sc-actions", ActionsElement);
