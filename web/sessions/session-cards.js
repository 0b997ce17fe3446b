// The sessions that there are, as cards: searched, filtered by how far they came, opened, removed.

import { api } from "../state/api.js";
import { cellWords } from "../measure/cell-words.js";
import { h, keyed, make } from "../dom.js";
import { when } from "../format.js";
import { icon, mark } from "../icons.js";
import { stages } from "../state/registries.js";
import { maybe, plural, t } from "../texts.js";
import { DrawingElement } from "../measure/drawing.js";
import { drift } from "./drift.js";

/** @import {Release, SessionSummary} from "../state/model.js" */

const FILTERS = /** @type {const} */ (["all", "pass", "warn", "fail", "unsolved", "archived"]);
const AT_ONCE = 48;

export class SessionCardsElement extends HTMLElement {
  /** @type {SessionSummary[]} */ #sessions = [];
  /** The stages whose result can be checked again. @type {Set<string>} */ #answers = new Set();
  /** What is in force, by cell. @type {Map<string, Release>} */ #inForce = new Map();
  /** The list does not wait for it, and does without it where it cannot be had. @type {Promise<void>} */ #told = Promise.resolve();
  #most = AT_ONCE;
  /** @type {Set<string>} */ #chosen = new Set();
  #several = h("div", { class: "several row", role: "group", "aria-label": t("start.several"), hidden: true });
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
      h("div", { class: "row spread" }, h("h2", { id: "sessions-title" }, t("start.sessions")), h("div", { class: "row finding" }, h("a", { href: "#ways-title" }, t("start.begin")), h("a", { href: "/compare" }, t("start.compare")), this.#filter, this.#search)),
      this.#several, this.#list, this.#none, this.#more, this.#count);
  }

  /** Answers whether there are any. */
  async load() {
    const [sessions, known] = await Promise.all([api.sessions(), stages()]).finally(() => { this.#loading.hidden = true; });
    this.#sessions = sessions;
    this.#answers = new Set(known.filter(({ is_answer }) => is_answer).map(({ name }) => name));
    this.#section.hidden = this.#sessions.length === 0;
    this.#chosen = new Set(this.#sessions.map(({ id }) => id).filter((id) => this.#chosen.has(id)));
    this.#show();
    this.dispatchEvent(new CustomEvent("loaded", { detail: this.#sessions.length }));
    this.#told = this.#sessions.length ? this.#loadInForce() : Promise.resolve();
  }

  async #loadInForce() {
    const cells = await api.cells().catch(() => []);
    this.#inForce = new Map(cells.flatMap(({ id, released }) => (released ? [[id, released]] : [])));
    if (this.#inForce.size) drawInForce ??= (await import("../result/released-answer.js")).inForce;
    this.#show();
  }

  get #searching() {
    return this.#search.value.trim() !== "" || this.#filter.value !== "all";
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
      // What was archived is out of sight until it is asked for.
      const standsThere = wanted === "archived" ? session.archived : !session.archived && (wanted === "all" || wanted === standing(session));
      return words.every((word) => text.includes(word)) && standsThere;
    });
    const cells = this.#cells(found);
    keyed(this.#list, cells.slice(0, this.#most), (cell) => cell.map((session) => `${session.id} ${session.name} ${version(session)}`).join(), (cell) => this.#card(cell), (card, cell) => this.#tellInForce(card, cell));
    this.#none.hidden = found.length > 0;
    this.#more.hidden = cells.length <= this.#most;
    this.#offerSeveral();
    this.#count.textContent = words.length || wanted !== "all" ? plural(found.length, "start.found_one", "start.found_many") : "";
  }

  /** A cell stands as its newest session; those before it stand behind it. @param {SessionSummary[]} found @returns {SessionSummary[][]} */
  #cells(found) {
    if (this.#searching) return found.map((session) => [session]);
    /** @type {Map<string, SessionSummary[]>} */
    const cells = new Map();
    for (const session of found) cells.set(session.cell_id, [...(cells.get(session.cell_id) ?? []), session]);
    return [...cells.values()];
  }

  /** @param {SessionSummary[]} sessions of one cell, the newest first */
  #card(sessions) {
    const [session, ...earlier] = sessions;
    if (!session) return h("li");
    return h(
      "li", { class: "session-card" },
      picture(session),
      h("h3", {}, h("a", { href: address(session) }, nameOf(session))),
      h("p", { class: "soft small" }, cellWords(session.cell)),
      h("p", { class: "small" }, plural(session.capture_count, "captures.one", "captures.many"), " · ", h("time", { datetime: session.updated }, when(session.updated))),
      h("p", { class: "verdicts" }, ...verdictsOf(session), drift(sessions.filter(({ verdicts }) => Object.keys(verdicts).some((stage) => this.#answers.has(stage))))),
      this.#isAnswered(session) && h("p", { class: "recheck" }, h("a", { href: `${address(session)}#recheck` }, t("step.recheck"))),
      this.#deeds(session),
      h("div", { class: "in-force-place" }),
      earlier.length > 0 && h("details", { class: "earlier" }, h("summary", { class: "small" }, plural(earlier.length, "start.earlier_one", "start.earlier_many")),
        h("ul", {}, ...earlier.map((one) => h("li", {}, h("a", { href: address(one) }, when(one.created)), h("span", { class: "verdicts small" }, ...verdictsOf(one)), this.#deeds(one))))),
    );
  }

  /** Whether there is an answer that could be checked again. @param {SessionSummary} session */
  #isAnswered(session) {
    return standings(session).some(([stage, verdict]) => this.#answers.has(stage) && verdict !== "stale");
  }

  /** At a cell what is in force for it; where single sessions are found, at the one that it is of. @param {Element} card @param {SessionSummary[]} sessions */
  #tellInForce(card, [session]) {
    const holder = card.querySelector(".in-force-place");
    const found = session && this.#inForce.get(session.cell_id);
    const release = found && (!this.#searching || found.session === session.id) ? found : undefined;
    const number = String(release?.number ?? "");
    if (!(holder instanceof HTMLElement) || (holder.dataset["number"] ?? "") === number) return; // what is open there stays open
    holder.dataset["number"] = number;
    const nameOfId = (/** @type {string} */ id) => this.#sessions.filter((one) => one.id === id).map(nameOf)[0];
    holder.replaceChildren(...(release && drawInForce ? [drawInForce(release, nameOfId, () => this.#rolledBack(release.cell))] : []));
  }

  /** @param {string} cell */
  async #rolledBack(cell) {
    await this.load();
    await this.#told;
    const card = [...this.#list.querySelectorAll(".in-force")].find((one) => one.getAttribute("data-cell") === cell);
    card?.querySelector("summary")?.focus();
  }

  /** @param {SessionSummary} session */
  #deeds(session) {
    const name = nameOf(session);
    const choose = h("input", { type: "checkbox", class: "choose", "aria-label": t("start.choose", { name }), ".checked": this.#chosen.has(session.id), onchange: () => {
      if (choose.checked) this.#chosen.add(session.id);
      else this.#chosen.delete(session.id);
      this.#offerSeveral();
    } });
    const button = (/** @type {"trash" | "rename" | "archive"} */ sign, /** @type {string} */ words, /** @type {"admin" | "capture"} */ needs, /** @type {() => unknown} */ act) =>
      h("button", { type: "button", class: `plain icon ${sign}`, needs, "aria-label": words, title: words, onclick: () => void act() }, icon(sign));
    return h("div", { class: "deeds row" }, choose,
      button("rename", t("start.rename", { name }), "capture", async () => (await deeds()).renameSession(session, () => this.load())),
      button("archive", t(session.archived ? "start.unarchive" : "start.archive", { name }), "capture", async () => (await deeds()).archiveSessions([session], !session.archived, () => this.load())),
      button("trash", t("start.remove", { name }), "admin", async () => (await deeds()).removeSessions([session], () => this.load())));
  }

  /** What can be done with those that are chosen. */
  #offerSeveral() {
    const chosen = this.#sessions.filter(({ id }) => this.#chosen.has(id));
    this.#several.hidden = chosen.length === 0;
    const [left, right, ...more] = chosen;
    this.#several.replaceChildren(
      h("strong", {}, t("captures.selected", { count: chosen.length })),
      left && right && !more.length ? h("a", { class: "button", href: `/compare?left=${left.id}&right=${right.id}` }, t("result.compare")) : "",
      h("button", { type: "button", onclick: async () => (await deeds()).saveArchives(chosen) }, t("start.save")),
      h("button", { type: "button", needs: "capture", onclick: async () => (await deeds()).archiveSessions(chosen, !chosen.every(({ archived }) => archived), () => this.load()) }, t(chosen.every(({ archived }) => archived) ? "start.unarchive_go" : "start.archive_go")),
      h("button", { type: "button", needs: "admin", class: "danger", onclick: async () => (await deeds()).removeSessions(chosen, () => this.load()) }, t("captures.delete")));
  }
}

/** Loaded with the first cell that has something in force. @type {typeof import("../result/released-answer.js").inForce | null} */
let drawInForce = null;

const deeds = () => import("./session-deeds.js");

/** @param {SessionSummary} session */
const nameOf = (session) => session.name || session.id;

/** @param {SessionSummary} session */
const address = (session) => `/sessions/${encodeURIComponent(session.id)}`;

/** A session's verdicts by stage, `stale` where its inputs have changed since. @param {SessionSummary} session @returns {[string, string][]} */
const standings = ({ verdicts, stale }) => Object.entries(verdicts).map(([stage, verdict]) => [stage, stale.some((one) => one === stage) ? "stale" : verdict]);

/** @param {SessionSummary} session */
function verdictsOf(session) {
  const found = standings(session);
  if (!found.length) return [mark("todo", t("start.unsolved"))];
  return found.map(([stage, verdict]) => mark(verdict, `${maybe(`step.${stage}`, stage)} ${maybe(`verdict.${verdict}`, verdict)}`));
}

/** The worst of a session's verdicts; one that is out of date has to be solved like none. @param {SessionSummary} session */
function standing(session) {
  const found = standings(session).map(([, verdict]) => verdict);
  if (found.includes("stale")) return "unsolved";
  return (/** @type {const} */ (["fail", "warn", "pass"])).find((one) => found.includes(one)) ?? "unsolved";
}

/** What changes with all that a card shows. @param {SessionSummary} session */
function version(session) {
  return `${session.updated}-${session.capture_count}-${session.archived}-${standings(session).join("-")}`;
}

/** The server's drawing of its poses; before the first capture the page's own of a cell. @param {SessionSummary} session */
function picture(session) {
  if (!session.capture_count) return h("div", { class: "picture" }, make(DrawingElement, { name: "cell" }));
  const address = `/scenes/${encodeURIComponent(session.id)}/picture?v=${encodeURIComponent(version(session))}`;
  return h("img", { class: "picture", src: address, alt: "", loading: "lazy", decoding: "async", width: 240, height: 120 });
}

customElements.define("sc-session-cards", SessionCardsElement);
