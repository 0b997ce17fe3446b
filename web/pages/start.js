// The first page: the sessions there are, and the ways to begin one.

import { api } from "../state/api.js";
import { cellDialog, cellDialogFor } from "../measure/cell-dialog.js";
import { copyButton } from "../components/copy.js";
import { DrawingElement } from "../measure/drawing.js";
import { ProgressElement } from "../components/progress.js";
import { SessionCardsElement } from "../sessions/session-cards.js";
import { attempt, notify } from "../components/toasts.js";
import { isFirstVisit, noteVisit } from "../sessions/tour.js";
import { takeDrops } from "../components/drops.js";
import { h, make, style } from "../dom.js";
import { chosen, dropped, isArchive, sessionFolder } from "../state/files.js";
import { me } from "../state/me.js";
import { go } from "../router.js";
import { t } from "../texts.js";
import { createFromFolder } from "../state/upload.js";

await style("start");

/** @import {Found} from "../state/files.js" */

const SEEDS = 10000;
/** Simulated cells of other topologies, as `scancell simulate` names them. */
const OTHER_CELLS = /** @type {const} */ ([
  "fixed-scanner", "fixed-scanner-turntable", "two-scanners", "two-scanners-in-turn", "scanners-on-flange-and-base",
  "two-scanners-turntable", "plate", "plate-distances", "plate-on-positioner", "rail", "slide", "tilt", "positioner", "positioner-geared",
  "rail-positioner", "two-tables", "gantry", "gantry-turntable", "scara", "linear-turntable",
]);

export class StartPage extends HTMLElement {
  #cards = make(SessionCardsElement);
  #progress = make(ProgressElement);
  #isBeginning = false;
  #folder = h("input", { type: "file", webkitdirectory: true, class: "visually-hidden", tabindex: -1, "aria-label": t("intake.folder"), onchange: () => void this.#take(chosen(this.#folder)) });
  #archive = h("input", { type: "file", accept: ".zip", class: "visually-hidden", tabindex: -1, "aria-label": t("way.archive_go"), onchange: () => void this.#take(chosen(this.#archive)) });

  connectedCallback() {
    if (!this.firstChild) this.append(this.#ways(), this.#progress, this.#cards, this.#folder, this.#archive);
    // Who comes back sees their cells first; with the keyboard the ways to begin are still the shorter way.
    this.#cards.addEventListener("loaded", (event) => this.classList.toggle("returning", /** @type {CustomEvent<number>} */ (event).detail > 0));
    takeDrops(this, (data) => void dropped(data).then((found) => this.#take(found)));
    void attempt(() => this.#cards.load()).then(() => performance.mark("scancell:ready"));
  }

  #ways() {
    return h(
      "section", { class: "ways", "aria-labelledby": "ways-title" },
      h("h1", { id: "ways-title" }, t("start.title")),
      h("p", { class: "soft" }, t("start.lead")),
      h("div", { class: "way-cards" },
        way("cell", t("way.simulated"), t("way.simulated_words"),
          h("button", { type: "button", needs: "capture", class: "primary", onclick: () => void this.#simulate("tcp") }, t("way.simulated_go")),
          h("button", { type: "button", needs: "capture", onclick: () => void this.#simulate("cell") }, t("way.simulated_turntable")),
          h("button", { type: "button", needs: "capture", onclick: () => void this.#simulate("frames-tcp") }, t("way.simulated_frames")), this.#otherCells()),
        way("files", t("way.files"), t("way.files_words"),
          h("button", { type: "button", needs: "capture", class: "primary", onclick: () => cellDialog() }, t("way.files_go")),
          h("button", { type: "button", needs: "capture", onclick: () => this.#folder.click() }, t("way.folder_go")),
          h("button", { type: "button", needs: "capture", onclick: () => this.#archive.click() }, t("way.archive_go"))),
        way("rest", t("way.rest"), t("way.rest_words"), snippet(), copyButton(program(), t("way.rest_go")),
          h("a", { class: "button", href: "/docs", target: "_blank" }, t("menu.docs"))),
      ),
      this.#tour(),
    );
  }

  #otherCells() {
    const choice = h("select", { "aria-label": t("start.other_cell") }, ...OTHER_CELLS.map((name) => h("option", { value: name }, t(`simulated.${name}`))));
    return h("div", { class: "row", needs: "capture" }, choice, h("button", { type: "button", onclick: () => void this.#simulate(choice.value) }, t("start.other_go")));
  }

  /** The tour is there on demand; at the first visit the page says so. */
  #tour() {
    const first = isFirstVisit();
    const button = h("button", { type: "button", needs: "capture", class: "plain wide", onclick: () => void this.#simulate("tcp", "#tour") }, t("tour.start"));
    const offer = h("p", { class: first ? "tour-offer first" : "tour-offer" }, first && `${t("tour.offer")} `, button);
    if (first) offer.append(h("button", { type: "button", class: "plain", onclick: () => { noteVisit(); offer.remove(); } }, t("tour.no")));
    offer.append(" ", h("button", { type: "button", class: "plain wide", onclick: async () => (await import("../guidance/plan-dialog.js")).planDialog() }, t("start.plan")));
    return offer;
  }

  /** @param {string} scenario @param {string} [hash] what the session's page opens with */
  async #simulate(scenario, hash = "") {
    if (this.#isBeginning) return; // the second half of a double click
    this.#isBeginning = true;
    this.#progress.show(t("start.simulating"));
    const seed = 1 + Math.floor(Math.random() * SEEDS);
    await attempt(async () => {
      const session = await api.createSession({ name: t("way.simulated_name", { seed }), simulated: { scenario, seed } });
      go(`/sessions/${session.id}${hash}`);
    });
    this.#isBeginning = false;
    this.#progress.end();
  }

  /** @param {Found[]} found */
  async #take(found) {
    this.#folder.value = this.#archive.value = "";
    if (this.#isBeginning) return;
    this.#isBeginning = true;
    const archive = found.find(isArchive);
    if (archive) await this.#import(archive.file);
    else if (found.length) await this.#takeFolder(found);
    this.#isBeginning = false;
    this.#progress.end();
  }

  /** Files with measurements, poses or a controller's among them begin a new session. @param {Found[]} found @returns {Promise<boolean>} whether they do */
  async #asTheyLie(found) {
    const known = await api.recogniseFiles(found, { taken_for: {} });
    if (known.files.every(({ taken_for: kind }) => kind === "nothing" || kind === "session" || kind === "certificate")) return false;
    const convention = known.poses.length ? known.convention?.name : undefined;
    await cellDialogFor(/** @type {import("../state/model.js").PoseConvention | undefined} */ (convention), found, known.sphere_diameter_mm ?? undefined);
    return true;
  }

  /** @param {File} file */
  async #import(file) {
    await attempt(async () => {
      const session = await api.importArchive(file, (share) => {
        if (share < 1) this.#progress.show(t("start.importing", { name: file.name, percent: Math.round(100 * share) }), share);
        else this.#progress.show(t("start.checking", { name: file.name }));
      });
      go(`/sessions/${session.id}`);
    });
  }

  /** @param {Found[]} found */
  async #takeFolder(found) {
    const folder = await sessionFolder(found).catch(() => undefined);
    let begun = false;
    if (folder === null && (!await attempt(async () => { begun = await this.#asTheyLie(found); }) || begun)) return;
    if (!folder) {
      notify(t(folder === undefined ? "intake.bad_json" : "start.no_session"), { bad: true });
      return;
    }
    await attempt(async () => {
      const { session, outcome } = await createFromFolder(folder, (sent, all) => this.#progress.show(t("intake.sending", { sent, all }), sent / all));
      go(`/sessions/${session.id}`);
      for (const problem of outcome.problems.slice(0, 1)) notify(problem, { bad: true });
      if (outcome.left.length > 1) notify(t("intake.waiting", { count: outcome.left.length }), { bad: true });
    });
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

function program() {
  const root = `${window.location.origin}/api/v1`;
  const cell = '{"name": "cell 4", "cell": {"pose_convention": "fanuc", "sphere_diameter_mm": 80, "scanner": {"kind": "profile"}}}';
  const record = '{"id": "p01", "step": "tcp", "kind": "profile", "files": ["p01.csv"], "pose": [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]}';
  const login = me().login === "not-needed" ? "" : '-H "Authorization: Bearer $SCANCELL_TOKEN" ';
  return [
    `curl ${login}${root}/sessions -H 'Content-Type: application/json' \\`, `  -d '${cell}'`,
    `curl ${login}${root}/sessions/ID/captures \\`, `  -F 'record=${record}' -F files=@p01.csv`,
    `curl ${login}-X POST ${root}/sessions/ID/solve/tcp`,
  ].join("\n");
}

function snippet() {
  return h("pre", { class: "snippet", tabindex: 0, "aria-label": t("way.rest_snippet") }, program());
}

customElements.define("sc-start", StartPage);
