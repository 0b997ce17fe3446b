// A session: what to do now, the evidence, and the scene beside it all.

import { ActionsElement } from "../measure/actions.js";
import { CapturesElement } from "../measure/captures.js";
import { FolderWatchElement } from "../measure/folder-watch.js";
import { GuideElement } from "../measure/guide.js";
import { IntakeElement } from "../measure/intake.js";
import { LiveElement } from "../components/connection.js";
import { QualityElement } from "../measure/quality.js";
import { RailElement } from "../measure/rail.js";
import { SceneElement } from "../measure/scene.js";
import { WaysInElement } from "../measure/ways-in.js";
import { api } from "../state/api.js";
import { attempt, forgive } from "../components/toasts.js";
import { takeDrops } from "../components/drops.js";
import { h, make } from "../dom.js";
import { loaded } from "../state/http.js";
import { SessionState } from "../state/session.js";
import { said, t } from "../texts.js";
import { cellWords } from "../measure/cell-words.js";
import { forgetDeeds } from "../state/undo.js";
import { redoLast, undoLast } from "../measure/undo.js";
import { splitter } from "../components/splitter.js";
import { viewTabs } from "../measure/view-tabs.js";

const LIVE = "scancell-live-";
const INTERACTIVE = "a, button, input, select, textarea, summary, dialog, [role=button], [role=tab], [tabindex='0']";

export class SessionPage extends HTMLElement {
  sessionId = "";
  /** @type {HTMLElement | null} */ top = null;
  /** @type {SessionState | null} */ #state = null;
  #name = h("h1", { class: "session-name", hidden: true });
  #cell = h("p", { class: "soft small" });
  #edit = h("button", { type: "button", class: "plain wide small", needs: "capture", hidden: true, onclick: () => void this.#correct() }, t("cell.correct"));
  #circumstances = h("button", { type: "button", class: "plain wide small", needs: "capture", hidden: true, onclick: () => void this.#tellCircumstances() }, t("circumstances.open"));
  #problem = h("section", { class: "lost", hidden: true });
  #loading = h("p", { class: "lost soft", role: "status" }, t("session.loading"));
  /** @type {ActionsElement | null} */ #actions = null;
  #devices = h("div", { class: "devices-place" });

  connectedCallback() {
    const state = new SessionState(this.sessionId);
    this.#state = state;
    const toured = window.location.hash === "#tour";
    Object.assign(state, placeIn(window.location.hash));
    const intake = make(IntakeElement, { state });
    const watch = make(FolderWatchElement, { state });
    this.#actions = make(ActionsElement, { state, intake, watch, devices: () => void this.#openDevices(state) });
    this.#build(state, [intake, watch], this.#actions);
    document.addEventListener("keydown", this.#key);
    window.addEventListener("hashchange", this.#hash);
    state.watch(["session", "problem"], () => this.#update(state));
    state.watch(["view", "step"], () => this.#address(state));
    void attempt(() => state.start()).then(() => {
      if (state.session && window.localStorage.getItem(`${LIVE}${state.id}`)) void this.#follow(state);
      state.addEventListener("change", (event) => {
        if (/** @type {CustomEvent<Set<string>>} */ (event).detail.has("devices")) void this.#follow(state);
      });
      performance.mark("scancell:ready");
      if (toured && state.session) void import("../sessions/tour.js").then(({ SESSION_STOPS, tour }) => tour(SESSION_STOPS));
    });
  }

  disconnectedCallback() {
    this.#state?.stop();
    forgetDeeds();
    document.removeEventListener("keydown", this.#key);
    window.removeEventListener("hashchange", this.#hash);
  }

  /**
   * @param {SessionState} state
   * @param {[IntakeElement, FolderWatchElement]} sources
   * @param {ActionsElement} actions
   */
  #build(state, sources, actions) {
    const limits = h("div", { class: "limits-place" });
    let limited = false;
    state.watch(["step", "session"], () => {
      // A form that only a verification has is loaded with its step.
      if (limited || state.stageOf(state.step) !== "verify") return;
      limited = true;
      void loaded(() => import("../measure/limits.js")).then(({ LimitsElement }) => limits.replaceChildren(make(LimitsElement, { state })));
    });
    const measure = h("div", { id: "view-measure", role: "tabpanel", "aria-labelledby": "tab-measure", class: "view" },
      make(GuideElement, { state }), limits, make(WaysInElement, { state, intake: sources[0], devices: () => void this.#openDevices(state) }), this.#devices, make(QualityElement, { state }), ...sources, make(CapturesElement, { state }));
    const result = h("div", { id: "view-result", role: "tabpanel", "aria-labelledby": "tab-result", class: "view" });
    let drawn = false;
    state.watch(["view"], () => {
      measure.hidden = state.view !== "measure";
      result.hidden = state.view !== "result";
      // What draws results is loaded with the first look at one.
      if (result.hidden || drawn) return;
      drawn = true;
      void loaded(() => import("../result/result.js")).then(({ ResultElement }) => result.append(make(ResultElement, { state })));
    });
    const work = h("div", { class: "work", "data-drop": t("intake.drop") }, viewTabs(state), measure, result, actions);
    state.watch(["step", "view"], () => { work.scrollTop = 0; });
    state.watch(["step"], () => forgive((_, { status }) => status !== 0)); // what was refused there is of no matter here
    this.top?.replaceChildren(h("div", { class: "session-title" }, this.#name, this.#cell, this.#edit, this.#circumstances), make(LiveElement, { state }));
    const session = h("div", { class: "session" }, make(RailElement, { state }), work);
    session.append(splitter(session), make(SceneElement, { state }));
    this.append(this.#loading, this.#problem, session);
    takeDrops(this, (data) => void sources[0].drop(data));
  }

  /** The live cell's panel is loaded when it is asked for, or a device speaks. @param {SessionState} state */
  async #follow(state) {
    const { livePanel } = await loaded(() => import("../live/panel.js"));
    if (!this.#devices.firstChild) this.#devices.append(livePanel(state));
    window.localStorage.setItem(`${LIVE}${state.id}`, "1");
  }

  /** As somebody asked for: in sight. @param {SessionState} state */
  async #openDevices(state) {
    await this.#follow(state);
    state.show("measure");
    this.#devices.scrollIntoView({ block: "start" });
  }

  /** @param {SessionState} state */
  #update(state) {
    const { session, problem } = state;
    this.#problem.hidden = !problem || session !== null;
    this.#loading.hidden = session !== null || problem !== null;
    if (problem?.status === 404 && !session) {
      state.stop(); // there is nothing to follow any more
      this.top?.replaceChildren();
    }
    if (problem && !session) {
      this.#problem.replaceChildren(h("h1", {}, said(problem.body.title ?? "")), h("p", {}, problem.message), h("a", { href: "/" }, t("lost.back")));
    }
    this.classList.toggle("without-session", !session);
    if (!session) return;
    this.#name.hidden = false;
    this.#name.textContent = this.#name.title = session.name || session.id;
    this.#cell.textContent = (session.simulated ? `${t("cell.simulated")} · ` : "") + cellWords(session.cell);
    this.#edit.hidden = session.simulated;
    this.#circumstances.hidden = false;
    document.title = `${session.name || session.id} · scancell`;
  }

  async #correct() {
    const { cellDialog } = await import("../measure/cell-dialog.js");
    await attempt(async () => cellDialog(await api.session(this.sessionId))); // what was saved a moment ago may not have been told yet
  }

  async #tellCircumstances() {
    const { circumstancesDialog } = await import("../equipment/circumstances.js");
    await circumstancesDialog(this.sessionId);
  }

  /** What is open stands in the address: `#tcp`, `#tcp.result`, `#result`. @param {SessionState} state */
  #address({ chosen, view }) {
    const words = [chosen, view === "result" && "result"].filter(Boolean).join(".");
    const hash = words && `#${words}`;
    if (window.location.hash !== hash) window.history.replaceState(null, "", window.location.pathname + hash);
  }

  /** What was said before its language had it is said again. */
  #hash = () => {
    const { chosen, view } = placeIn(window.location.hash);
    this.#state?.open(chosen, view);
  };

  /** @param {KeyboardEvent} event */
  #key = (event) => {
    if (event.defaultPrevented || event.altKey || document.querySelector("dialog[open]")) return;
    const target = event.target instanceof Element ? event.target : document.body;
    const typing = target.closest("input:not([type=checkbox]), textarea, select") !== null;
    if (typing) return;
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey) {
      if (key === "z") act(event, () => void (event.shiftKey ? redoLast() : undoLast()));
      else if (key === "y") act(event, () => void redoLast());
      return;
    }
    const state = this.#state;
    const free = target.closest(INTERACTIVE) === null;
    if (key === " " && free && state?.session?.simulated) act(event, () => void this.#actions?.capture());
    else if (key === "s") act(event, () => void this.#actions?.solve());
    else if (key === "enter" && free) act(event, () => this.#actions?.goOn());
    else if (key === "?") act(event, () => void import("../measure/keys.js").then(({ keysDialog }) => keysDialog()));
    else if (key === "m") act(event, () => state?.show("measure"));
    else if (key === "r") act(event, () => state?.show("result"));
    else if (/^[1-9]$/.test(key) && state?.steps[Number(key) - 1]) act(event, () => state.open(state.steps[Number(key) - 1] ?? null));
  };
}

/** @param {string} hash @returns {{ chosen: string | null, view: "measure" | "result" }} */
function placeIn(hash) {
  const [, step = "", result] = /^#(?!tour$|result$)([a-z-]+)(\.result)?$/.exec(hash) ?? [];
  return { chosen: step || null, view: result || hash === "#result" ? "result" : "measure" };
}

/** @param {KeyboardEvent} event @param {() => void} action */
function act(event, action) {
  event.preventDefault();
  if (!event.repeat) action();
}

customElements.define("sc-session", SessionPage);
