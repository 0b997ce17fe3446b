// The verification's limits where its captures are taken: a form until the first one, then what is set; a change is kept and told.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { did, patchBack } from "../state/undo.js";
import { maybe, t } from "../texts.js";
import { StateElement } from "../components/base.js";
import { schemaForm } from "../components/schema-form.js";
import { attempt } from "../components/toasts.js";
import { whyDialog } from "./why-dialog.js";

const STAGE = "verify";
const FIELD = "verification";
/** What most cells ask of a tool. */
const USUAL_MM = 1;

/** Beside the limits `changes`, which the server keeps. @typedef {Record<string, unknown>} Limits */

export class LimitsElement extends StateElement {
  #shown = "";
  /** Whether captures were taken for it: a change is then kept with its reason. */ #begun = false;

  parts = /** @type {const} */ (["session", "captures", "step"]);

  update() {
    const { state } = this;
    const stage = state.stages.find(({ name }) => name === STAGE);
    const limits = /** @type {Limits} */ (/** @type {Record<string, unknown>} */ (state.session?.cell ?? {})[FIELD] ?? {});
    this.hidden = !stage || state.stageOf(state.step) !== STAGE;
    const begun = this.#begun = state.captures.some(({ step }) => stage?.steps?.includes(step));
    const now = JSON.stringify([this.hidden, begun, limits]);
    if (this.hidden || now === this.#shown) return; // what is being typed stays
    this.#shown = now;
    this.replaceChildren(h("section", { class: "panel", "aria-labelledby": "limits-title" }, h("h2", { id: "limits-title" }, t("limits.title")),
      ...(begun ? [...listed(limits), h("details", {}, h("summary", {}, t("limits.change")), h("p", { class: "soft" }, t("limits.late_words")), this.#form(stage, limits, t("limits.change_go")))]
        : [h("p", { class: "soft" }, t("limits.words")), this.#form(stage, limits, t("limits.go"))])));
  }

  /** @param {{ settings?: unknown } | undefined} stage @param {Limits} limits @param {string} go */
  #form(stage, limits, go) {
    const begun = Object.values(limits).some((value) => typeof value === "number");
    const form = schemaForm(stage?.settings ?? {}, begun ? limits : { tool_mm: USUAL_MM }, { prefix: FIELD, ids: "limits", go, submit: (chosen) => this.#set(limits, chosen) });
    // One limit is what most need; the others, and what they are measured with, stand behind it.
    const rest = [...form.querySelectorAll(".field")].slice(1);
    const more = h("details", {}, h("summary", {}, t("limits.more")), ...rest);
    form.querySelector(".field")?.after(more);
    return form;
  }

  /** @param {Limits} before @param {Record<string, unknown>} chosen */
  async #set(before, chosen) {
    const { id } = this.state;
    const to = (/** @type {unknown} */ limits, why = "") => api.changeSession(id, { cell: { [FIELD]: limits }, ...(why ? { why } : {}) });
    const back = patchBack(before, chosen);
    const act = async (why = "") => {
      await to(chosen, why);
      did(t("limits.set"), () => to(back), { tell: true, redo: () => to(chosen, why) });
    };
    if (this.#begun) whyDialog({ title: t("limits.change"), words: [t("limits.late_words")], go: t("limits.change_go"), act, after: () => undefined });
    else await attempt(() => act());
  }
}

/** @param {Limits} limits */
function listed(limits) {
  const set = Object.entries(limits).filter(([, value]) => typeof value === "number");
  if (!set.length) return [h("p", { class: "soft" }, t("limits.none"))];
  return [h("p", { class: "soft" }, t("limits.held")), h("dl", { class: "pairs" }, ...set.map(([name, value]) => h("div", {}, h("dt", {}, maybe(`settings.${FIELD}.${name}`, name)), h("dd", { class: "number" }, String(value)))))];
}

customElements.define("sc-limits", LimitsElement);
