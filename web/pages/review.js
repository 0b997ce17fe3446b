// A session as it was: its time line on top, and below it what was known at the place that is chosen. Read-only.

import "../texts/later.js";
import { api } from "../state/api.js";
import { KeptElement } from "../result/archived-files.js";
import { RailElement } from "../measure/rail.js";
import { RecomputeElement } from "../result/recompute.js";
import { ResultElement } from "../result/result.js";
import { ReviewCapturesElement } from "../compare/review-captures.js";
import { ReviewLogElement } from "../compare/review-log.js";
import { SceneElement } from "../measure/scene.js";
import { TimelineElement } from "../compare/timeline.js";
import { attempt } from "../components/toasts.js";
import { h, make, style } from "../dom.js";
import { mark } from "../icons.js";
import { ReviewState } from "../state/review.js";
import { said, t } from "../texts.js";
import { cellWords } from "../measure/cell-words.js";

style("review");

export class ReviewPage extends HTMLElement {
  sessionId = "";
  /** @type {HTMLElement | null} */ top = null;
  /** @type {ReviewState | null} */ #state = null;
  #name = h("h1", { class: "session-name" });
  #cell = h("p", { class: "soft small" });

  connectedCallback() {
    const state = new ReviewState(this.sessionId);
    this.#state = state;
    const id = encodeURIComponent(this.sessionId);
    this.top?.replaceChildren(
      h("div", { class: "session-title" }, this.#name, this.#cell, mark("pass", t("review.read_only"))),
      h("nav", { class: "review-links row", "aria-label": t("review.links") },
        h("a", { href: `/sessions/${id}` }, t("review.session")), h("a", { href: api.reportAddress(this.sessionId), target: "_blank" }, t("result.report")),
        h("a", { href: api.archiveAddress(this.sessionId), download: "" }, t("review.archive")),
        h("button", { type: "button", onclick: () => window.print() }, t("review.print"))));
    this.append(
      make(TimelineElement, { state }),
      h("div", { class: "review" },
        make(RailElement, { state }),
        h("div", { class: "review-work" },
          make(ResultElement, { state }), make(ReviewCapturesElement, { state }), make(RecomputeElement, { sessionId: this.sessionId }), make(KeptElement, { sessionId: this.sessionId }), make(ReviewLogElement, { state })),
        make(SceneElement, { state })));
    state.watch(["session", "problem"], () => this.#update(state));
    void attempt(() => state.start());
  }

  disconnectedCallback() {
    this.#state?.stop();
  }

  /** @param {ReviewState} state */
  #update({ session, problem }) {
    if (problem && !session) {
      this.replaceChildren(h("section", { class: "lost" }, h("h1", {}, said(problem.body.title ?? "")), h("p", {}, problem.message), h("a", { href: "/" }, t("lost.back"))));
      return;
    }
    if (!session) return;
    this.#name.textContent = session.name || session.id;
    this.#cell.textContent = (session.simulated ? `${t("cell.simulated")} · ` : "") + cellWords(session.cell);
    document.title = t("review.title", { name: session.name || session.id });
  }
}

customElements.define("sc-review", ReviewPage);
