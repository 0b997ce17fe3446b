// One large sign that is read from the robot: its colour and words say whether to hold still, to go on, or what is wrong.

import { h } from "../dom.js";
import { sound } from "../shop.js";
import { maybe, said, t } from "../texts.js";

/** @import {Preview} from "../state/live.js" */

const TAKEN_MS = 2500;
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

  /** @param {Preview} preview */
  show(preview) {
    const { last } = preview;
    const taken = last ? `${last.id} ${last.verdict}` : "";
    if (this.#last !== null && taken !== this.#last && last) {
      this.#untilMs = performance.now() + TAKEN_MS;
      sound(last.verdict, this.sounds);
    }
    this.#last = taken;
    const [state, words] = performance.now() < this.#untilMs && last ? told(last) : stateOf(preview);
    this.dataset["state"] = state;
    if (this.#words.textContent !== words) this.#words.textContent = words;
  }
}

/** @param {NonNullable<Preview["last"]>} last @returns {[string, string]} */
function told({ id, verdict }) {
  const values = { capture: id, verdict: maybe(`quality.${verdict}`, verdict) };
  return [VERDICTS[verdict] ?? "wait", t(verdict === "fail" ? "sign.refused" : "sign.taken", values)];
}

/** @param {Preview} preview @returns {[string, string]} */
function stateOf({ devices, robot, automatic, waits_for: waits }) {
  if (!devices.length) return ["none", t("sign.none")];
  const lost = devices.find(({ status, fresh }) => status !== "live" || !fresh);
  const status = lost?.status === "live" ? "stale" : lost?.status ?? "";
  if (lost) return ["bad", t("sign.lost", { name: lost.name, status: maybe(`device.${status}`, status), problem: said(lost.problem) })];
  if (robot?.moving) return ["move", t("sign.moving")];
  if (automatic && /another place/.test(waits)) return ["good", t("sign.go")];
  return automatic && waits ? ["wait", t("sign.waiting", { reason: said(waits) })] : ["ready", t("sign.ready")];
}

customElements.define("sc-live-sign", SignElement);
