// The first page: the sessions there are, and the three ways to begin one.

import { api } from "../api.js";
import { DrawingElement } from "../components/drawing.js";
import { cellDialog } from "../components/cell-dialog.js";
import { copyButton } from "../components/copy.js";
import { attempt, notify } from "../components/toasts.js";
import { h, make } from "../dom.js";
import { chosen, dropped, isMeasurement, sessionFolder } from "../files.js";
import { when } from "../format.js";
import { icon, mark } from "../icons.js";
import { go } from "../router.js";
import { maybe, plural, t } from "../texts.js";
import { createFromFolder } from "../upload.js";

/** @import {SessionSummary} from "../model.js" */
/** @import {Found} from "../files.js" */

const SEEDS = 10000;

export class StartPage extends HTMLElement {
  /** @type {SessionSummary[]} */ #sessions = [];
  #search = h("input", { type: "search", id: "search", placeholder: t("start.search"), "aria-label": t("start.search"), oninput: () => this.#show() });
  #list = h("ul", { class: "session-cards" });
  #count = h("p", { class: "visually-hidden", "aria-live": "polite" });
  #sessionsPart = h("section", { class: "sessions", "aria-labelledby": "sessions-title", hidden: true },
    h("div", { class: "row spread" }, h("h2", { id: "sessions-title" }, t("start.sessions")), this.#search), this.#list, this.#count);
  #folder = h("input", { type: "file", webkitdirectory: true, class: "visually-hidden", tabindex: -1, "aria-label": t("intake.folder"), onchange: () => void this.#take(chosen(this.#folder)) });
  #busy = h("p", { class: "busy", role: "status" });

  connectedCallback() {
    if (!this.firstChild) this.append(this.#ways(), this.#busy, this.#sessionsPart, this.#folder);
    this.addEventListener("dragover", (event) => event.preventDefault());
    this.addEventListener("drop", (event) => {
      event.preventDefault();
      if (event.dataTransfer) void dropped(event.dataTransfer).then((found) => this.#take(found));
    });
    void attempt(() => this.#load()).then(() => performance.mark("scancell:ready"));
  }

  #ways() {
    return h(
      "section", { class: "ways", "aria-labelledby": "ways-title" },
      h("h1", { id: "ways-title" }, t("start.title")),
      h("p", { class: "soft" }, t("start.lead")),
      h("div", { class: "way-cards" },
        way("cell", t("way.simulated"), t("way.simulated_words"),
          h("button", { type: "button", class: "primary", onclick: () => void this.#simulate("tcp") }, t("way.simulated_go")),
          h("button", { type: "button", onclick: () => void this.#simulate("turntable") }, t("way.simulated_turntable")),
          h("button", { type: "button", onclick: () => void this.#simulate("frames-tcp") }, t("way.simulated_frames"))),
        way("files", t("way.files"), t("way.files_words"),
          h("button", { type: "button", class: "primary", onclick: () => cellDialog() }, t("way.files_go")),
          h("button", { type: "button", onclick: () => this.#folder.click() }, t("way.folder_go"))),
        way("rest", t("way.rest"), t("way.rest_words"), snippet(), copyButton(program(), t("way.rest_go")),
          h("a", { class: "button", href: "/docs", target: "_blank" }, t("way.rest_docs"))),
      ),
    );
  }

  async #load() {
    this.#sessions = await api.sessions();
    this.#sessionsPart.hidden = this.#sessions.length === 0;
    this.#show();
  }

  #show() {
    const words = this.#search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const shown = this.#sessions.filter((session) => {
      const text = `${session.name} ${session.id} ${session.cell.pose_convention} ${when(session.updated)}`.toLowerCase();
      return words.every((word) => text.includes(word));
    });
    this.#list.replaceChildren(...shown.map((session) => this.#card(session)));
    this.#count.textContent = words.length ? plural(shown.length, "start.found_one", "start.found_many") : "";
  }

  /** @param {SessionSummary} session */
  #card(session) {
    const name = session.name || session.id;
    const verdicts = Object.entries(session.verdicts ?? {});
    return h(
      "li", { class: "session-card" },
      h("h3", {}, h("a", { href: `/sessions/${encodeURIComponent(session.id)}` }, name)),
      h("p", { class: "soft small" }, cellWords(session.cell)),
      h("p", { class: "small" }, plural(session.capture_count, "captures.one", "captures.many"), " · ", when(session.updated)),
      h("p", { class: "verdicts" }, ...(verdicts.length
        ? verdicts.map(([stage, verdict]) => mark(verdict, `${maybe(`step.${stage}`, stage)} ${maybe(`verdict.${verdict}`, verdict)}`))
        : [mark("todo", t("start.unsolved"))])),
      h("button", { type: "button", class: "plain icon remove", "aria-label": t("start.remove", { name }), title: t("start.remove", { name }), onclick: () => this.#remove(session) }, icon("trash")),
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
        await attempt(() => this.#load());
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

  /** @param {string} scenario */
  async #simulate(scenario) {
    this.#busy.textContent = t("start.simulating");
    const seed = 1 + Math.floor(Math.random() * SEEDS);
    await attempt(async () => {
      const session = await api.createSession({ name: t("way.simulated_name", { seed }), simulated: { scenario, seed } });
      go(`/sessions/${session.id}`);
    });
    this.#busy.textContent = "";
  }

  /** @param {Found[]} found */
  async #take(found) {
    this.#folder.value = "";
    if (!found.length) return;
    const folder = await sessionFolder(found).catch(() => undefined);
    if (folder === undefined) return notify(t("intake.bad_json"), { bad: true });
    if (folder === null) {
      if (found.some(isMeasurement)) notify(t("start.files_first"), { bad: true });
      else notify(t("start.no_session"), { bad: true });
      return;
    }
    await attempt(async () => {
      const { session, outcome } = await createFromFolder(folder, (sent, all) => {
        this.#busy.textContent = t("intake.sending", { sent, all });
      });
      go(`/sessions/${session.id}`);
      for (const problem of outcome.problems.slice(0, 3)) notify(problem, { bad: true });
    });
    this.#busy.textContent = "";
  }
}

/**
 * @param {string} drawing
 * @param {string} title
 * @param {string} words
 * @param {...Node} actions
 */
function way(drawing, title, words, ...actions) {
  const snippets = actions.filter((node) => node instanceof HTMLPreElement);
  return h("article", { class: "way" }, make(DrawingElement, { name: drawing }), h("h2", {}, title), h("p", { class: "soft" }, words),
    ...snippets, h("div", { class: "row" }, ...actions.filter((node) => !snippets.includes(/** @type {HTMLPreElement} */ (node)))));
}

/** @param {SessionSummary["cell"]} cell */
export function cellWords(cell) {
  const parts = [maybe(`convention.${cell.pose_convention}`, cell.pose_convention)];
  if (cell.scanner?.kind) parts.push(maybe(`kind.${cell.scanner.kind}`, cell.scanner.kind));
  if (cell.sphere_diameter_mm) parts.push(t("cell.sphere", { diameter: cell.sphere_diameter_mm }));
  return parts.join(" · ");
}

function program() {
  const root = `${window.location.origin}/api/v1`;
  const cell = '{"name": "cell 4", "cell": {"pose_convention": "fanuc", "sphere_diameter_mm": 80, "scanner": {"kind": "profile"}}}';
  const record = '{"id": "p01", "step": "tcp", "kind": "profile", "files": ["p01.csv"], "pose": [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]}';
  return [
    `curl ${root}/sessions -H 'Content-Type: application/json' \\`, `  -d '${cell}'`,
    `curl ${root}/sessions/ID/captures \\`, `  -F 'record=${record}' -F files=@p01.csv`,
    `curl -X POST ${root}/sessions/ID/solve/tcp`,
  ].join("\n");
}

function snippet() {
  return h("pre", { class: "snippet", tabindex: 0, "aria-label": t("way.rest_snippet") }, program());
}

customElements.define("sc-start", StartPage);
