// The panel that lays files and pose lines side by side before anything is stored.

import "../texts/later.js";
import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { field, h, make } from "../dom.js";
import { typedNumbers } from "../format.js";
import { kindOf, knowFormats, match, sessionFolder, stemOf, takenOf } from "../state/files.js";
import { plural, t } from "../texts.js";
import { did } from "../state/undo.js";
import { draftKey, freeId, send, takeBrought, takeWaiting } from "../state/upload.js";
import { StateElement } from "../components/base.js";
import { addedWithReason } from "./add-reason.js";
import { tellSent } from "./sent-captures.js";
import { imageOf, matchTable, numbersOf, pictureOf } from "./match-row.js";
import { PoseColumnsElement } from "./pose-columns.js";
import { knowConventions } from "../state/pose-table.js";
import { stepName } from "./rail.js";
import { attempt, notify } from "../components/toasts.js";

/** @import {Found} from "../state/files.js" */
/** @import {Capture, ParsedPose} from "../state/model.js" */
/** @import {Parcel} from "../state/upload.js" */

const READ_AFTER_MS = 200;
/** From so many captures on a step may be solved at once. */
const ENOUGH_TO_SOLVE = 5;

export class IntakePanelElement extends StateElement {
  /** @type {Found[]} */ #files = [];
  /** Stored already while others were refused: never sent twice. @type {Set<File>} */ #stored = new Set();
  /** @type {ParsedPose[]} */ #poses = [];
  /** What could not be stored before, by path. @type {Set<string>} */ #waiting = new Set();
  #listedText = "";
  #timer = 0;
  #reading = 0;
  #restored = false;
  #isSending = false;
  #isKnown = () => {};
  #known = new Promise((/** @type {(value?: unknown) => void} */ resolve) => { this.#isKnown = resolve; });
  #text = h("textarea", { id: "pose-lines", rows: 6, spellcheck: "false", autocomplete: "off", oninput: () => this.#later() });
  #step = h("select", { onchange: () => this.#draw() });
  #angles = h("textarea", { id: "intake-angles", rows: 2, spellcheck: "false", autocomplete: "off", oninput: () => this.#draw() });
  #mount = h("input", { id: "intake-mount", autocomplete: "off", "aria-describedby": "intake-mount-hint" });
  #pairs = h("input", { id: "intake-pairs", type: "checkbox", onchange: () => this.#draw() });
  #columns = make(PoseColumnsElement, { changed: () => void this.#read() });
  /** Loaded with the first poses. @type {import("./pose-offers.js").PoseOffersElement | null} */ #offers = null;
  #offersPlace = h("div");
  /** Loaded with the first files. @type {import("./file-list.js").FileListElement | null} */ #list = null;
  #listPlace = h("div");
  /** Loaded with the first file of a controller. @type {import("./pose-file.js").PoseFileElement | null} */ #poseFile = null;
  #poseFilePlace = h("div", {});
  /** Loaded with the first file. @type {import("./file-reading.js").FileReadingElement | null} */ #scannerFile = null;
  #scannerFilePlace = h("div");
  #poseField = h("div", { class: "field" }, h("label", { for: "pose-lines" }, t("intake.poses")), h("span", { class: "hint", id: "pose-hint" }, t("intake.pose_hint")), this.#text, this.#offersPlace, this.#poseFilePlace, this.#columns);
  #turning = h("div", { hidden: true, class: "field" },
    h("label", { for: "intake-angles" }, t("intake.angles")), this.#angles,
    h("label", { for: "intake-mount" }, t("place.mount")), h("span", { class: "hint", id: "intake-mount-hint" }, t("place.mount_hint")), this.#mount);
  #paired = h("div", { hidden: true, class: "row" }, this.#pairs, h("label", { for: "intake-pairs" }, t("intake.pairs")));
  #table = h("div", { class: "match", role: "region", tabindex: 0, "aria-label": t("match.label"), "aria-live": "polite" });
  #add = h("button", { type: "button", class: "primary", onclick: () => void this.#send() }, t("intake.add_none"));
  #addAndSolve = h("button", { type: "button", hidden: true, onclick: () => void this.#sendAndSolve() }, t("intake.add_solve"));
  #panel = h(
    "section", { class: "panel intake-panel", "aria-labelledby": "intake-title", hidden: true },
    h("div", { class: "row spread" }, h("h2", { id: "intake-title" }, t("intake.title")), h("button", { type: "button", class: "plain", onclick: () => this.close() }, t("close"))),
    h("p", { class: "soft" }, t("intake.how")),
    field("intake-step", t("intake.step"), this.#step),
    this.#listPlace, this.#poseField, this.#turning, this.#paired, this.#scannerFilePlace, this.#table,
    h("div", { class: "row end" }, this.#addAndSolve, this.#add),
  );

  parts = /** @type {const} */ (["session"]);

  build() {
    this.#text.setAttribute("aria-describedby", "pose-hint");
    this.append(this.#panel);
  }

  /** What was typed outlives a reload in the middle of it; files must be chosen again, browsers keep none. */
  #keep() {
    const draft = { text: this.#text.value, angles: this.#angles.value, mount: this.#mount.value, step: this.#step.value };
    if (draft.text || draft.angles) window.sessionStorage.setItem(draftKey(this.state.id), JSON.stringify(draft));
    else window.sessionStorage.removeItem(draftKey(this.state.id));
  }

  #restore() {
    const kept = window.sessionStorage.getItem(draftKey(this.state.id));
    if (!kept) return;
    const { text, angles, mount, step } = JSON.parse(kept);
    [this.#text.value, this.#angles.value, this.#mount.value, this.#step.value] = [text, angles, mount, step];
    this.#panel.hidden = false;
    void this.#read();
  }

  update() {
    const convention = this.state.session?.cell.pose_convention;
    if (!convention) return;
    this.#columns.convention = convention;
    if (this.#restored) return;
    this.#restored = true;
    this.#step.replaceChildren(...this.state.captureSteps.map((step) => h("option", { value: step }, stepName(this.state, step))));
    if (!this.#panel.hidden) this.#step.value = this.#likelyStep();
    this.#restore();
    this.#isKnown();
    this.#wait(takeWaiting(this.state.id));
    const brought = takeBrought(this.state.id);
    if (brought.length) void this.take(brought);
  }

  /** What could not be stored stays in the table, to be given its pose. @param {readonly Parcel[]} parcels */
  #wait(parcels) {
    const files = parcels.flatMap(({ record, files: all }) => all.map((file) => ({ path: `${record.id}${/\.[^.]+$/.exec(file.name)?.[0] ?? ""}`, file })));
    if (!files.length) return;
    for (const { path } of files) this.#waiting.add(path);
    const [first] = parcels;
    void attempt(knowFormats).then(() => {
      this.#files.push(...files);
      this.open();
      if (first) this.#step.value = first.record.step;
      this.#draw();
    });
  }

  /** Open the panel for pose lines. */
  open() {
    if (this.#panel.hidden) this.#step.value = this.#likelyStep();
    this.#panel.hidden = false;
    this.#draw();
    (this.state.showsBoard(this.#step.value) ? this.#step : this.#text).focus({ preventScroll: true });
    this.#panel.scrollIntoView({ block: "start" });
  }

  /** The guide's step; but boards are seen in frames alone, so other files are captures of the sphere. */
  #likelyStep() {
    const { step, captureSteps } = this.state;
    const frames = this.#files.length > 0 && this.#files.every(({ path }) => this.#kindOf(path) === "frame");
    const sphere = captureSteps.find((one) => !this.state.showsBoard(one)) ?? step;
    return captureSteps.includes(step) && (frames || !this.state.showsBoard(step)) ? step : sphere;
  }

  /** Whether the sphere stands on the table. */
  get #onTable() {
    return this.state.shows(this.#step.value) === "sphere-on-table";
  }

  close() {
    [this.#files, this.#poses] = [[], []];
    this.#waiting.clear();
    this.#stored.clear();
    this.#offers?.clear();
    this.#text.value = this.#angles.value = "";
    this.#keep();
    this.#panel.hidden = true;
    this.#columns.read("");
    this.#list?.clear();
    this.#poseFile?.clear();
    this.#scannerFile?.clear();
    this.#showInScene();
  }

  /** What is listed and not stored. */
  get unsent() { return (this.#list?.found ?? []).filter(({ file }) => !this.#stored.has(file)); }

  /** @param {Found[]} found */
  async take(found) {
    await this.#known; // the steps: files may be dropped before they have come
    if (!await attempt(knowFormats)) return;
    const folder = await sessionFolder(found).catch(() => undefined);
    if (folder === undefined) {
      notify(t("intake.bad_json"), { bad: true });
    } else if (folder) {
      const { cell, name } = /** @type {{cell?: unknown, name?: string}} */ (folder.record);
      // A session that holds nothing yet becomes the one in the folder; a filled one keeps its cell.
      const taken = this.state.captures.length > 0 || await attempt(() => api.changeSession(this.state.id, { cell, ...(name ? { name } : {}) }));
      if (!taken) return;
      this.#wait((await this.#deliver(folder.captures)).left);
    } else {
      await this.#takeFiles(found);
    }
  }

  /** Every file that came is listed with what it was taken for, before anything is added. @param {Found[]} found */
  async #takeFiles(found) {
    if (!found.length) return;
    const { FileListElement } = await import("./file-list.js");
    this.#list ??= make(FileListElement, { changed: () => void attempt(() => this.#listed()) });
    this.#listPlace.replaceChildren(this.#list);
    const list = this.#list;
    if (!await attempt(() => list.take(found))) return;
    const taken = this.#listed();
    this.open();
    await taken;
  }

  /** What the list says is taken up: the measurements, the poses as lines, how both pair. */
  async #listed() {
    const list = this.#list;
    if (!list) return;
    this.#files = [...this.#files.filter(({ path }) => this.#waiting.has(path)), ...list.measurements];
    const { controllers } = list;
    if (controllers.length) await (await this.#controllerFile()).take(this.state.id, controllers, this.state.session?.cell.robot?.arm).catch(unlessProblem);
    else this.#poseFile?.clear();
    if (list.convention) {
      this.#columns.choose(list.convention);
      this.#text.value = list.lines;
    } else if (this.#text.value === this.#listedText) {
      this.#text.value = "";
    }
    this.#listedText = list.lines;
    await this.#read();
    const { FileReadingElement } = await import("./file-reading.js");
    this.#scannerFile ??= make(FileReadingElement);
    this.#scannerFilePlace.replaceChildren(this.#scannerFile);
    await attempt(async () => this.#scannerFile?.look(this.#files, this.state.session?.cell, this.#kindOf));
  }

  /** @param {string} path */
  #kindOf = (path) => this.#list?.kindOf(path) ?? kindOf(path, this.state.session?.cell.scanner?.kind);

  async #controllerFile() {
    if (!this.#poseFile) {
      const { PoseFileElement } = await import("./pose-file.js");
      this.#poseFile = make(PoseFileElement, { changed: () => this.#draw() });
      this.#poseFilePlace.append(this.#poseFile);
    }
    return this.#poseFile;
  }

  #later() {
    this.#keep();
    window.clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => void this.#read(), READ_AFTER_MS);
  }

  async #read() {
    const reading = ++this.#reading;
    // Which column is what, only the conventions tell: without them a table would be taken for plain lines.
    if (!await attempt(async () => void await knowConventions()) || reading !== this.#reading) return;
    this.#columns.read(this.#text.value);
    const text = this.#columns.lines;
    await attempt(async () => {
      const read = text.trim() ? await api.readPoseLines(this.state.id, text, this.#columns.convention) : { items: [] };
      const offers = await this.#offered();
      if (reading === this.#reading) this.#poses = offers.take(read, this.state.shows(this.#step.value) === "sphere");
    });
    this.#draw();
    this.#showInScene();
  }

  async #offered() {
    const { PoseOffersElement } = await import("./pose-offers.js");
    if (!this.#offers) {
      this.#offers = make(PoseOffersElement, { columns: this.#columns, changed: () => void this.#read() });
      this.#offersPlace.replaceChildren(this.#offers);
    }
    return this.#offers;
  }

  /** The scene shows at once where the poses put the flange. */
  #showInScene() {
    api.tryPoses(this.state.id, this.#poses.flatMap(({ matrix }) => (matrix ? [matrix] : [])));
  }

  #rows() {
    const list = this.#list;
    if (list && list.lines === this.#text.value && list.measurements.length === this.#files.length && this.#poses.length === list.poseCount) return list.rows;
    return match(this.#files.map(({ path }) => path), this.#poses.map(({ text }) => text));
  }

  /** Frames of the board: one a capture, or the lit board and then its stripe. @returns {Parcel[]} */
  #boards() {
    const taken = new Set(this.state.captures.map((capture) => capture.id));
    const step = /** @type {Capture["step"]} */ (this.#step.value);
    const count = this.#pairs.checked && !this.#paired.hidden ? 2 : 1;
    const groups = Array.from({ length: Math.floor(this.#files.length / count) }, (_, index) => this.#files.slice(index * count, (index + 1) * count));
    return groups.filter((group) => !group.some(({ file }) => this.#stored.has(file))).map((group) => {
      const id = freeId(taken, stemOf(group[0]?.path ?? ""));
      taken.add(id);
      const files = group.map(({ path }, index) => `captures/${id}${index ? "-stripe" : ""}${path.slice(path.lastIndexOf(".")).toLowerCase()}`);
      return { record: { id, step, kind: "frame", files, ...takenOf(group[0]?.file) }, files: group.map(({ file }) => file) };
    });
  }

  /** What can be sent: a file with a pose that could be read, and with the table's angle where it turns. @returns {Parcel[]} */
  #parcels() {
    if (this.state.showsBoard(this.#step.value)) return this.#boards();
    const taken = new Set(this.state.captures.map((capture) => capture.id));
    const step = /** @type {Capture["step"]} */ (this.#step.value);
    const angles = typedNumbers(this.#angles.value); // in the files' order
    return this.#rows().flatMap(({ file, line }) => {
      const found = file === null ? undefined : this.#files[file];
      const pose = line === null ? undefined : this.#poses[line];
      const angle = (pose && (this.#columns.angle(pose.line) ?? this.#angleOf(pose.text))) ?? (file === null ? undefined : angles[file]);
      const turns = this.#onTable || (this.state.shows(step) === "object" && angle !== undefined);
      if (!found || this.#stored.has(found.file) || !pose?.matrix || (turns && !Number.isFinite(angle))) return [];
      const id = freeId(taken, stemOf(found.path));
      taken.add(id);
      const kind = this.#kindOf(found.path);
      const ending = found.path.slice(found.path.lastIndexOf("."));
      const mount = this.#mount.value.trim();
      const table = turns ? { table_deg: Number(angle), ...(mount && this.#onTable ? { mount } : {}) } : {};
      const record = { id, step, ...table, kind, ...takenOf(found.file), files: [`captures/${id}${ending.toLowerCase()}`], pose: numbersOf(pose), ...this.#list?.recordOf(pose.text), ...this.#scannerFile?.record };
      return [{ record, files: [found.file] }];
    });
  }

  /** The table's angle that a file tells for a line. @param {string} line */
  #angleOf(line) {
    const pose = this.#list?.poseOf(line);
    return pose && (pose.table_deg ?? this.#poseFile?.angleAt(pose.file, pose.line));
  }

  #draw() {
    this.#keep();
    const step = this.#step.value;
    const boards = this.state.showsBoard(step);
    this.#turning.hidden = !this.#onTable && this.state.shows(step) !== "object";
    this.#poseField.hidden = boards;
    this.#paired.hidden = !boards || step === this.state.captureSteps[0]; // the camera alone needs no stripe
    const rows = boards ? this.#files.map((_, file) => ({ file, line: null })) : this.#rows();
    const ready = this.#parcels().length;
    this.#add.textContent = ready ? plural(ready, "intake.add_one", "intake.add_many") : t("intake.add_none");
    this.#add.setAttribute("aria-disabled", String(ready === 0));
    this.#addAndSolve.hidden = ready < ENOUGH_TO_SOLVE || this.state.stageOf(step) !== step;
    if (!rows.length) return this.#table.replaceChildren();
    this.#table.replaceChildren(matchTable(rows.map(({ file, line }) => {
      const found = file === null ? undefined : this.#files[file];
      const picture = boards ? null : found && this.#pictureOf(found);
      return { found, pose: line === null ? undefined : this.#poses[line], isStored: !!found && this.#stored.has(found.file), picture };
    }), boards));
  }

  /** A measurement's small picture. @param {Found} found */
  #pictureOf({ path, file }) {
    const preview = this.#list?.previewOf(path) ?? [];
    if (preview.length) return pictureOf(path, preview);
    return this.#kindOf(path) === "frame" ? imageOf(file) : null;
  }

  /** @param {number} sent @param {number} all */
  #progress = (sent, all) => {
    this.#add.textContent = t("intake.sending", { sent, all });
  };

  /** The actions beside it solve once all are stored. */
  async #sendAndSolve() {
    if (await this.#send()) this.dispatchEvent(new Event("solve"));
  }

  /** Whether all could be stored. @returns {Promise<boolean>} */
  async #send() {
    const parcels = this.#isSending ? [] : this.#parcels(); // once, however often it is clicked
    if (!parcels.length || !await attempt(() => this.#adoptConvention())) return false;
    const outcome = await addedWithReason(this.state, (why) => {
      const because = why ? { added_because: { why } } : {};
      return this.#deliver(parcels.map(({ record, files }) => ({ record: { ...record, ...because }, files })));
    });
    if (!outcome) return false;
    for (const file of outcome.files) this.#stored.add(file);
    if (outcome.problems.length) this.#draw();
    else this.close();
    return !outcome.problems.length;
  }

  /** Send, and tell it once table and guide show what came. @param {readonly Parcel[]} parcels */
  async #deliver(parcels) {
    this.#isSending = true;
    this.state.adds(true);
    try {
      const outcome = await send(this.state.id, parcels, this.#progress);
      if (outcome.sent.length) await this.state.reload();
      tellSent(this.state.id, outcome);
      return outcome;
    } finally {
      this.#isSending = false;
      this.state.adds(false);
    }
  }

  /** The poses were looked at in another convention than the cell's: that one becomes the cell's. */
  async #adoptConvention() {
    const before = this.state.session?.cell.pose_convention;
    const now = this.#columns.convention;
    if (before === now || this.#poseField.hidden) return;
    await api.changeSession(this.state.id, { cell: { pose_convention: now } });
    const set = (/** @type {string | undefined} */ convention) => api.changeSession(this.state.id, { cell: { pose_convention: convention } });
    did(t("cell.changed"), () => set(before), { redo: () => set(now) });
  }
}

/** A refusal that the list has told already. @param {unknown} error */
function unlessProblem(error) {
  if (!(error instanceof Problem)) throw error;
}

customElements.define("sc-intake-panel", IntakePanelElement);
