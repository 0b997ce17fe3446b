// Two results side by side: two sessions, or two solves of one. What is compared stands in the address.

import "../texts/later.js";
import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { comparisonSections } from "../compare/comparison.js";
import { attempt } from "../components/toasts.js";
import { stages } from "../state/registries.js";
import { field, h, style } from "../dom.js";
import { when } from "../format.js";
import { maybe, t } from "../texts.js";

/** @import {Comparison, PastResult, SessionSummary} from "../state/model.js" */

const SIDES = /** @type {const} */ (["left", "right"]);

style("review");
export class ComparePage extends HTMLElement {
  /** @type {HTMLElement | null} */ top = null;
  #query = new URLSearchParams(window.location.search);
  /** Answers may come in another order than they were asked for: only the latest counts. */
  #asked = 0;
  #answer = h("div", { class: "comparison", "aria-live": "polite" });
  #stage = h("select", { onchange: () => void this.#changed("stage", this.#stage.value) });
  /** @type {Record<"left" | "right", { session: HTMLSelectElement, solve: HTMLSelectElement }>} */
  #chosen = { left: this.#side("left"), right: this.#side("right") };

  connectedCallback() {
    document.title = t("comparison.page_title");
    this.append(
      h("h1", {}, t("comparison.title")), h("p", { class: "soft" }, t("comparison.lead")),
      h("form", { class: "compare-form panel", onsubmit: (/** @type {Event} */ event) => event.preventDefault() },
        field("compare-stage", t("comparison.stage"), this.#stage),
        ...SIDES.flatMap((side) => [
          field(`compare-${side}`, t(`comparison.${side}`), this.#chosen[side].session),
          field(`compare-${side}-solve`, t("comparison.solve"), this.#chosen[side].solve)])),
      this.#answer);
    void attempt(async () => {
      const [sessions, known] = await Promise.all([api.sessions(), stages()]);
      const sides = SIDES.map((side) => this.#value(side).split(":")[0]);
      const named = sessions.filter(({ id }) => sides.includes(id));
      /** How many have one to compare. @param {keyof SessionSummary["verdicts"]} name */
      const solved = (name) => (named.length ? named : sessions).filter(({ verdicts }) => verdicts[name]).length;
      const wanted = this.#value("stage") || [...known].sort((a, b) => solved(b.name) - solved(a.name))[0]?.name;
      this.#stage.append(...known.map(({ name, title }) => h("option", { value: name, selected: name === wanted }, maybe(`step.${name}`, title ?? name))));
      for (const side of SIDES) this.#offer(side, sessions);
      await this.#refresh();
    });
  }

  /** @param {string} name @param {string} otherwise */
  #value(name, otherwise = "") {
    return this.#query.get(name) ?? otherwise;
  }

  /** @param {"left" | "right"} side */
  #side(side) {
    const changed = () => void this.#changed(side, session.value + (solve.value ? `:${solve.value}` : ""));
    const session = h("select", { onchange: () => void this.#changed(side, session.value) });
    const solve = h("select", { onchange: changed });
    return { session, solve };
  }

  /** @param {"left" | "right"} side @param {SessionSummary[]} sessions */
  #offer(side, sessions) {
    const [id] = this.#value(side).split(":");
    const solved = sessions.filter((session) => Object.keys(session.verdicts).length || session.id === id);
    this.#chosen[side].session.replaceChildren(
      h("option", { value: "" }, t("choose")),
      ...solved.map((session) => h("option", { value: session.id, selected: session.id === id }, `${session.name || session.id} · ${when(session.created)}`)));
  }

  /** @param {string} name @param {string} value */
  async #changed(name, value) {
    this.#query.set(name, value);
    // A solve is one of its step.
    if (name === "stage") for (const side of SIDES) this.#query.set(side, this.#value(side).split(":")[0] ?? "");
    window.history.replaceState(null, "", `/compare?${this.#query}`);
    await attempt(() => this.#refresh());
  }

  async #refresh() {
    const asked = ++this.#asked;
    const stage = this.#stage.value;
    if (!stage) return; // chosen before the steps were there: what they bring asks with it
    await Promise.all(SIDES.map((side) => this.#offerSolves(side, stage)));
    if (asked !== this.#asked) return;
    const [left, right] = SIDES.map((side) => this.#value(side));
    this.#answer.replaceChildren(h("p", { class: "soft" }, t("comparison.wait")));
    if (!left || !right) return this.#answer.replaceChildren(h("p", { class: "soft" }, t("comparison.two")));
    try {
      const comparison = await api.compare(stage, left, right);
      if (asked === this.#asked) this.#answer.replaceChildren(...comparisonSections(comparison, names(comparison)));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      if (asked === this.#asked) this.#answer.replaceChildren(h("p", { class: "reason reason-fail", role: "alert" }, error.message));
    }
  }

  /** @param {"left" | "right"} side @param {string} stage */
  async #offerSolves(side, stage) {
    const [id, number] = this.#value(side).split(":");
    /** @type {PastResult[]} */
    const items = id ? await api.history(id, stage) : [];
    this.#chosen[side].solve.replaceChildren(
      h("option", { value: "" }, t("history.latest")),
      ...items.map((item) => h("option", { value: item.number, selected: String(item.number) === number }, `${when(item.created)} · ${maybe(`verdict.${item.verdict}`, item.verdict)} · ${t("evidence.used_of", { rows: item.used, count: item.captures })}`)));
  }
}

/** @param {Comparison} comparison */
function names({ left, right }) {
  if (left.session === right.session) return { left: t("comparison.first", { when: when(left.created) }), right: t("comparison.second", { when: when(right.created) }) };
  return { left: left.name || left.session, right: right.name || right.session };
}

customElements.define("sc-compare", ComparePage);
