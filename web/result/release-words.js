// What is said of a release, beside an answer and at its cell.

import { h } from "../dom.js";
import { plusMinus, when } from "../format.js";
import { mark } from "../icons.js";
import { maybe, t } from "../texts.js";

/** @import {Release} from "../state/model.js" */

const K = 2;

/** A name as it stands; where nobody has to log in, what is kept instead. @param {string} who */
export const named = (who) => (who === "this machine" ? t("release.machine") : who);

/** Who put it in force, when and why. @param {Release} release */
export function releaseWords({ action, who, why, created, in_spite_of: faults, signed }) {
  const values = { who: named(who), when: when(created), why };
  const name = action === "rollback" ? "rolled" : "who";
  const words = t(why ? `release.${name}_why` : `release.${name}`, values);
  const said = faults.length ? t("release.in_spite_of", { said: words, faults: faults.map(faultWords).join(" ") }) : words;
  return signed ? said : t("release.unsigned", { said });
}

/** Verdict, and how well the workpiece is known. @param {Pick<Release, "verdict" | "workpiece_sigma_mm">} answer */
export function worth({ verdict, workpiece_sigma_mm: sigma }) {
  return [mark(verdict, maybe(`verdict.${verdict}`, verdict)),
    sigma ? h("span", { class: "number" }, t("release.at_workpiece", { uncertainty: plusMinus(K * sigma, "mm") })) : null];
}

/** @param {string} name of a fault */
export const faultWords = (name) => maybe(`release.fault.${name}`, name);

/** @param {readonly string[]} names of faults */
export const faultMarks = (names) => names.map((name) => h("p", { class: "soft" }, mark("fail", faultWords(name))));

/** Whether two releases, or a release and an answer, are of the same numbers. @param {Pick<Release, "session" | "solved" | "inputs_sha256">} one @param {Pick<Release, "session" | "solved" | "inputs_sha256">} other */
export function sameAnswer(one, other) {
  const inputs = (/** @type {Record<string, string> | null} */ hashes) => JSON.stringify(Object.entries(hashes ?? {}).sort());
  return one.session === other.session && one.solved === other.solved && inputs(one.inputs_sha256) === inputs(other.inputs_sha256);
}

/** @param {string} id */
export const sessionAddress = (id) => `/sessions/${encodeURIComponent(id)}`;
