// The sessions that there are, as cards: searched, filtered by how far they came, opened, removed.

import { api } from "../state/api.js";
import { cellWords } from "./cell-words.js";
import { h, keyed, make } from "../dom.js";
import { when } from "../format.js";
import { icon, mark } from "../icons.js";
import { maybe, plural, t } from "../texts.js";
import { DrawingElement } from "./drawing.js";
import { attempt, notify } from "./toasts.js";

/** @import {SessionSummary} from "../state/model.js" */

const FILTERS = /** @type {const} */ (["all", "pass", "warn", "fail", "unsolved"]);
const AT_ONCE = 48;

export class SessionCardsElement extends HTMLElement {
  /** @type {SessionSummary[]} */ #sessions = [];
  #most = AT_ONCE;
  #search = h("input", { type: "search", id: "search", placeholder: t("start.search"), "aria-label": t("start.search"), oninput: () => this.#again() });
  #filter = h("select", { id: "filter", "aria-label": t("start.filter"), onchange: () => this.#again() }, ...FILTERS.map((one) => h("option", { value: one }, t(`filter.${one}`))));
  #list = h("ul", { class: "session-cards" });
  #none = h("p", { class: "soft", hidden: true }, t("start.found_none"));
  #more = h("button", { type: "button", hidden: true, onclick: () => this.#showMore() }, t("start.more"));
  #count = h("p", { class: "visually-hidden", "aria-live": "polite" });
  #section = Object.assign(this.#build(), { hidden: true });
  #loading = h("p", { class: "soft", role: "status" }, t("start.loading"));

  connectedCallback() {
    if (this.firstChild) return;
    this.append(this.#loading, this.#section);
  }

  #build() {
    return h("section", { class: "sessions", "aria-labelledby": "sessions-title" },
      h("div", { class: "row spread" }, h("h2", { id: "sessions-title" }, t("start.sessions")), h("div", { class: "row finding" }, h("a", { href: "/compare" }, t("start.compare")), this.#filter, this.#search)),
      this.#list, this.#none, this.#more, this.#count);
  }

  async load() {
    this.#sessions = await api.sessions().finally(() => { this.#loading.hidden = true; });
    this.#section.hidden = this.#sessions.length === 0;
    this.#show();
  }

  #again() {
    this.#most = AT_ONCE;
    this.#show();
  }

  #showMore() {
    const before = this.#most;
    this.#most += AT_ONCE;
    this.#show();
    this.#list.children[before]?.querySelector("a")?.focus();
  }

  #show() {
    const words = this.#search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const wanted = this.#filter.value;
    const found = this.#sessions.filter((session) => {
      const text = `${session.name} ${session.id} ${cellWords(session.cell)} ${when(session.updated)}`.toLowerCase();
      return words.every((word) => text.includes(word)) && (wanted === "all" || wanted === standing(session));
    });
    keyed(this.#list, found.slice(0, this.#most), (session) => `${session.id} ${version(session)}`, (session) => this.#card(session), () => undefined);
    this.#none.hidden = found.length > 0;
    this.#more.hidden = found.length <= this.#most;
    this.#count.textContent = words.length || wanted !== "all" ? plural(found.length, "start.found_one", "start.found_many") : "";
  }

  /** @param {SessionSummary} session */
  #card(session) {
    const name = session.name || session.id;
    const verdicts = Object.entries(session.verdicts ?? {});
    return h(
      "li", { class: "session-card" },
      picture(session),
      h("h3", {}, h("a", { href: `/sessions/${encodeURIComponent(session.id)}` }, name)),
      h("p", { class: "soft small" }, cellWords(session.cell)),
      h("p", { class: "small" }, plural(session.capture_count, "captures.one", "captures.many"), " · ", h("time", { datetime: session.updated }, when(session.updated))),
      h("p", { class: "verdicts" }, ...(verdicts.length
        ? verdicts.map(([stage, verdict]) => mark(verdict, `${maybe(`step.${stage}`, stage)} ${maybe(`verdict.${verdict}`, verdict)}`))
        : [mark("todo", t("start.unsolved"))])),
      h("button", { type: "button", class: "plain icon remove", needs: "admin", "aria-label": t("start.remove", { name }), title: t("start.remove", { name }), onclick: () => this.#remove(session) }, icon("trash")),
    );
  }

  /** @param {SessionSummary} session */
  #remove(session) {
    const name = session.name || session.id;
    const dialog = h("dialog", { "aria-labelledby": "remove-title" });
    const remove = async () => {
      dialog.close();
      if (await attempt(() => api.removeSession(session.id))) {
        notify(t("start.removed", { name }));
        await attempt(() => this.load());
      }
    };
    dialog.append(h("div", { class: "body" },
      h("h2", { id: "remove-title" }, t("start.remove", { name })),
      h("p", {}, t("start.remove_words", { captures: plural(session.capture_count, "captures.one", "captures.many") })),
      h("div", { class: "row end" },
        h("button", { type: "button", autofocus: true, onclick: () => dialog.close() }, t("cancel")),
        h("button", { type: "button", class: "danger", onclick: () => void remove() }, t("start.remove_go")))));
    dialog.addEventListener("close", () => dialog.remove());
    document.body.append(dialog);
    dialog.showModal();
  }
}

/** The worst of a session's verdicts. @param {SessionSummary} session */
function standing({ verdicts }) {
  const found = Object.values(verdicts ?? {});
  return (/** @type {const} */ (["fail", "warn", "pass"])).find((one) => found.includes(one)) ?? "unsolved";
}

/** What changes with all that a card shows. @param {SessionSummary} session */
function version({ updated, capture_count, verdicts }) {
  return `${updated}-${capture_count}-${Object.entries(verdicts ?? {}).join("-")}`;
}

/** The server's drawing of its poses; before the first capture the page's own of a cell. @param {SessionSummary} session */
function picture(session) {
  if (!session.capture_count) return h("div", { class: "picture" }, make(DrawingElement, { name: "cell" }));
  const address = `/scenes/${encodeURIComponent(session.id)}/picture?v=${encodeURIComponent(version(session))}`;
  return h("img", { class: "picture", src: address, alt: "", loading: "lazy", decoding: "async", width: 240, height: 120 });
}

customElements.define("sc-session-cards", SessionCardsElement);
