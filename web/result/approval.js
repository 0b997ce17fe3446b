// Approving the session's one answer: who did, when and why, and whether it is what programs get that ask the cell.

import { api } from "../state/api.js";
import { h, putChildren } from "../dom.js";
import { mark } from "../icons.js";
import { may } from "../state/me.js";
import { stand } from "./answer.js";
import { said, t } from "../texts.js";
import { faultMarks, faultWords, releaseWords, sameAnswer, sessionAddress, worth } from "./release-words.js";
import { attempt, say } from "../components/toasts.js";
import { whyDialog } from "../measure/why-dialog.js";

/** @import {Release, SessionAnswer} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

export class ApprovalElement extends HTMLElement {
  /** Of a session with an answer. @type {SessionState} */ state = /** @type {any} */ (null);
  #title = h("h2", { id: "approval-title", tabindex: -1 }, t("release.title"));
  #section = h("section", { class: "panel approval", "aria-labelledby": "approval-title", hidden: true });

  /** What is shown, so that it stays where nothing is new. */ #shown = "";
  /** @type {(() => void) | null} */ #stop = null;

  connectedCallback() {
    if (!this.firstChild) this.append(this.#section);
    this.#stop = this.state.watch(["release", "results"], () => void attempt(() => this.load()));
  }

  disconnectedCallback() {
    this.#stop?.();
  }

  async load() {
    const sessionId = this.state.id;
    const answer = await api.answer(sessionId);
    const releases = await api.releases(answer.cell);
    const brought = ownRelease(sessionId, answer, releases) ? "" : await broughtRelease(sessionId);
    const card = /** @type {HTMLElement | null} */ (document.querySelector(".answer-card"));
    if (card && answer.stage === this.state.stageOf(this.state.step)) stand(card, answer.faults);
    const shown = JSON.stringify([answer.inputs_sha256, answer.solved, answer.faults, answer.decided_before, releases, brought]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    putChildren(this.#section, [this.#title, ...standing(sessionId, answer, releases, brought), ...offer(sessionId, answer, releases)]);
    this.#section.hidden = false;
  }

  /** @param {Release} release */
  async tell(release) {
    await attempt(() => this.load());
    this.#title.focus();
    say(releaseWords(release));
  }
}

/** Who released it where it came from, as its archive tells. @param {string} sessionId */
async function broughtRelease(sessionId) {
  if (!(await api.kept(sessionId)).some(({ name }) => name === "release.json")) return "";
  return said((await api.timeline(sessionId)).find(({ brought }) => brought)?.message ?? "");
}

/** @param {string} sessionId @param {SessionAnswer} answer @param {readonly Release[]} releases the newest first @param {string} brought */
function standing(sessionId, answer, releases, brought) {
  const own = ownRelease(sessionId, answer, releases);
  const current = releases[0];
  const inForce = current && current === own;
  return [
    h("p", {}, own ? releaseWords(own) : t("release.none")),
    brought && h("p", { class: "soft" }, t("release.brought", { said: brought })),
    own && h("p", {}, mark(inForce ? "pass" : "skipped", t(inForce ? "release.current" : "release.not_current", { cell: answer.cell }))),
    current && !inForce && other(sessionId, current),
  ];
}

/** @param {string} sessionId @param {Release} current */
function other(sessionId, current) {
  if (current.session === sessionId) return h("p", { class: "soft" }, t("release.other"), " ", releaseWords(current));
  return h("p", { class: "soft" }, t("release.other_session"), " ", h("a", { href: sessionAddress(current.session) }, releaseWords(current)));
}

/** @param {string} sessionId @param {SessionAnswer} answer @param {readonly Release[]} releases */
function ownRelease(sessionId, answer, releases) {
  if (answer.stale) return undefined;
  return releases.find((one) => sameAnswer(one, { session: sessionId, solved: answer.solved, inputs_sha256: answer.inputs_sha256 }));
}

/** Faults of the moment that somebody may acknowledge by name. */
const ACKNOWLEDGED = ["drift", "equipment-changed"];

/** @param {string} cell @param {string} fault */
function acknowledging(cell, fault) {
  const ask = () => whyDialog({ title: t("release.acknowledge"), words: [faultWords(fault)], go: t("release.acknowledge"), act: (why) => api.acknowledge(cell, fault, why),
    after: () => { const shown = document.querySelector("sc-approval"); return shown instanceof ApprovalElement ? shown.load() : undefined; } });
  return h("button", { type: "button", "aria-label": `${t("release.acknowledge")}: ${faultWords(fault)}`, onclick: ask }, t("release.acknowledge"));
}

/** The button, or why there is none; what is in force has its faults too. @param {string} sessionId @param {SessionAnswer} answer @param {readonly Release[]} releases */
function offer(sessionId, answer, releases) {
  const own = ownRelease(sessionId, answer, releases);
  const inForce = own !== undefined && own === releases[0];
  const before = (answer.decided_before ?? []).map(({ text }) => h("p", { class: "soft" }, text ?? ""));
  const faults = [...before, ...faultMarks(answer.faults)];
  if (!may("release")) return inForce ? faults : [...faults, h("p", { class: "soft" }, t("may.release"))];
  const words = h("span", { class: "row" }, ...worth({ verdict: answer.verdict, workpiece_sigma_mm: answer.workpiece_sigma_mm ?? null }).filter((one) => one instanceof Node));
  const title = t(faults.length ? "release.approve_despite" : "release.approve");
  const ask = () => whyDialog({ title, words: [...answer.faults.map(faultWords), words, t("release.approve_words", { cell: answer.cell })], go: t("release.approve_go"),
    act: (why) => api.release(sessionId, why, answer.faults), after: approved });
  const deeds = answer.faults.filter((name) => ACKNOWLEDGED.includes(name)).map((name) => acknowledging(answer.cell, name));
  if (!inForce) deeds.unshift(h("button", { type: "button", onclick: ask }, title));
  return [...faults, h("div", { class: "row" }, ...deeds)];
}

/** The result may have been drawn again while the dialog was open: what is shown now is told. @param {Release} release */
function approved(release) {
  const shown = document.querySelector("sc-approval");
  return shown instanceof ApprovalElement ? shown.tell(release) : undefined;
}

customElements.define("sc-approval", ApprovalElement);
