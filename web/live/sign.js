// One large sign that is read from the robot: its colour and words say whether to hold still, to go on, or what is wrong.

import "../texts/later.js";
import { h } from "../dom.js";
import { sound } from "../shop.js";
import { maybe, said, t } from "../texts.js";

/** @import {Preview} from "../state/live.js" */

const TAKEN_MS = 2500;
/** No capture is taken without these: what is seen, and from where. */
const NEEDED = /** @type {const} */ (["scanner", "robot"]);
const VERDICTS = /** @type {Readonly<Record<string, string>>} */ ({ pass: "good", warn: "wait", fail: "bad" });

export class SignElement extends HTMLElement {
  sounds = false;
  #words = h("p", { role: "status" });
  #last = /** @type {string | null} */ (null);
  #untilMs = 0;

  connectedCallback() {
    this.setAttribute("aria-label", t("sign.label"));
    this.setAttribute("role", "group");
    if (!this.firstChild) this.append(this.#words);
  }

  /** @param {Preview} preview @param {string} lost since when the server tells nothing */
  show(preview, lost) {
    const { last } = preview;
    const taken = last ? `${last.id} ${last.verdict}` : "";
    if (this.#last !== null && taken !== this.#last && last) {
      this.#untilMs = performance.now() + TAKEN_MS;
      sound(last.verdict, this.sounds);
    }
    this.#last = taken;
    const [state, words] = lost ? ["bad", t("sign.link", { since: lost })] : performance.now() < this.#untilMs && last ? told(last) : stateOf(preview);
    this.dataset["state"] = state;
    if (this.#words.textContent !== words) this.#words.textContent = words;
  }
}

/** @param {NonNullable<Preview["last"]>} last @returns {[string, string]} */
function told({ id, verdict }) {
  const values = { capture: id, verdict: maybe(`quality.${verdict}`, verdict) };
  return [VERDICTS[verdict] ?? "wait", t(verdict === "fail" ? "sign.refused" : "sign.taken", values)];
}

/** What would be captured now, or what is missing. @param {Preview} preview @returns {[string, string]} */
function stateOf({ devices, robot, automatic, waits_for: waits, is_taken: taken, step }) {
  const missing = NEEDED.filter((role) => devices.every(({ delivers }) => !delivers.includes(role)));
  if (missing.length) return ["none", t("sign.missing", { devices: missing.map((role) => t(`sign.${role}`)).join(" + ") })];
  const lost = devices.find(({ status, fresh }) => status !== "live" || !fresh);
  const status = lost?.status === "live" ? "stale" : lost?.status ?? "";
  if (lost) return ["bad", t("sign.lost", { name: lost.name, status: maybe(`device.${status}`, status), problem: said(lost.problem) })];
  if (robot?.moving) return ["move", t("sign.moving")];
  if (taken) return ["good", t("sign.go")];
  if (waits) return ["wait", t("sign.waiting", { reason: said(waits) })];
  return ["ready", t(automatic ? "sign.automatic" : "sign.ready", { step: maybe(`step.${step}`, step) })];
}

customElements.define("sc-live-sign", SignElement);
