// Every file that came: what it was taken for, why, and another word for it; measurements and poses as they pair.

import "../texts/later.js";
import { api } from "../state/api.js";
import { h } from "../dom.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";

/** @import {Found} from "../state/files.js" */
/** @import {Capture, Kind, PoseConvention, RecognisedFiles, RecognisedPose} from "../state/model.js" */
/** @typedef {RecognisedFiles["files"][number]} RecognisedFile */
/** @typedef {{ reason: string, values: Record<string, unknown>, why: string }} Why */

const KINDS = /** @type {Record<string, Kind>} */ ({ profiles: "profile", clouds: "cloud", frames: "frame", boards: "frame" });
const CHOICES = ["profiles", "clouds", "frames", "boards", "poses", "backup", "nothing"];
const SHOWN = 8;

export class FileListElement extends HTMLElement {
  /** Called when a file is taken for something else. @type {() => void} */ changed = () => undefined;
  /** Those that came. @type {Found[]} */ found = [];
  /** What somebody said a file is. @type {Record<string, string>} */ #told = {};
  /** @type {RecognisedFiles | null} */ #known = null;
  /** By the first word of its line. @type {Map<string, RecognisedPose>} */ #lines = new Map();

  /** Look at files beside those that came before. @param {readonly Found[]} found */
  async take(found) {
    const names = new Set(found.map(({ path }) => path));
    this.found = [...this.found.filter(({ path }) => !names.has(path)), ...found];
    await this.#look();
  }

  clear() {
    [this.found, this.#told, this.#known] = [[], {}, null];
    this.#lines.clear();
    this.replaceChildren();
  }

  /** The measurements, in the order in which people count them. @returns {Found[]} */
  get measurements() {
    return this.#known?.pairs.flatMap(({ file }) => (file === null ? [] : this.found[file] ?? [])) ?? [];
  }

  /** Files of a controller: its tools and external axes are read besides. @returns {Found[]} */
  get controllers() {
    const taken = this.#known?.files ?? [];
    return this.found.filter((_, index) => taken[index]?.reason.startsWith("controller"));
  }

  /** A line for each pose; one that has a measurement begins with its name. */
  get lines() {
    return [...this.#lines].map(([name, { pose }]) => [name, ...pose].join(" ")).join("\n");
  }

  get poseCount() {
    return this.#lines.size;
  }

  /** Which measurement has which line, by their places. */
  get rows() {
    const pairs = this.#known?.pairs ?? [];
    return pairs.map(({ file, pose }, index) => ({ file: file === null ? null : index, line: pose }));
  }

  /** @returns {PoseConvention | null} */
  get convention() {
    return this.#known?.poses.length ? /** @type {PoseConvention} */ (this.#known.convention?.name ?? null) : null;
  }

  /** The sphere's diameter where one of the files tells it. */
  get diameter_mm() {
    return this.#known?.sphere_diameter_mm ?? null;
  }

  /** @param {string} path @returns {Kind | undefined} */
  kindOf(path) {
    return KINDS[this.#entry(path)?.taken_for ?? ""];
  }

  /** Some of a measurement's points, x and z. @param {string} path */
  previewOf(path) {
    return this.#entry(path)?.preview ?? [];
  }

  /** @param {string} line */
  poseOf(line) {
    return this.#lines.get(line.trim().split(/\s+/, 1)[0] ?? "");
  }

  /** What a capture's record keeps of the pose that a line stands for. @param {string} line @returns {Partial<Capture>} */
  recordOf(line) {
    const pose = this.poseOf(line);
    if (!pose) return {};
    return { source: `${pose.file}:${pose.line}`, ...(pose.joints_deg ? { joints_deg: pose.joints_deg } : {}), ...(pose.time_s === null ? {} : { device_time_s: pose.time_s }) };
  }

  /** @param {string} path */
  #entry(path) {
    return this.#known?.files[this.found.findIndex((one) => one.path === path)];
  }

  async #look() {
    this.#known = await api.recogniseFiles(this.found, { taken_for: this.#told });
    const { poses, pairs } = this.#known;
    const fileOf = new Map(pairs.map(({ file, pose }) => [pose, file === null ? undefined : this.found[file]?.path]));
    this.#lines = new Map();
    poses.forEach((pose, index) => this.#lines.set(freeName(this.#lines, stem(fileOf.get(index)) || pose.name), pose));
    this.#draw();
  }

  #draw() {
    if (!this.#known) return;
    const { files, missing, doubts } = this.#known;
    const lacking = [...doubts, ...missing.filter(({ reason }) => reason !== "missing-sphere")];
    const rows = files.map((file) => h("tr", {},
      h("td", {}, file.name),
      h("td", {}, h("select", { "aria-label": t("files.take_as", { name: file.name }), onchange: (/** @type {Event} */ { currentTarget }) => void this.#tell(file.name, /** @type {HTMLSelectElement} */ (currentTarget).value) },
        ...[...new Set([...CHOICES, file.taken_for])].map((kind) => h("option", { value: kind, selected: kind === file.taken_for }, maybe(`files.${kind}`, kind))))),
      h("td", {}, why(file))));
    const unused = files.filter(({ taken_for: kind }) => kind === "nothing").length;
    this.replaceChildren(h("section", { class: "file-list", "aria-label": t("files.label") },
      h("details", { open: files.length <= SHOWN || unused > 0 },
        h("summary", {}, mark(unused ? "warn" : "pass", summary(files))),
        h("div", { class: "rows", role: "region", tabindex: 0, "aria-label": t("files.label") }, h("table", {},
          h("thead", {}, h("tr", {}, ...(/** @type {const} */ (["file", "taken_for", "why"])).map((head) => h("th", { scope: "col" }, t(`files.head_${head}`))))),
          h("tbody", {}, ...rows)))),
      this.#paired(),
      lacking.length > 0 && h("ul", { class: "messages" }, ...lacking.map((one) => h("li", {}, mark("warn", why(one)))))));
  }

  #paired() {
    const { paired_by: by, pairs, convention, poses } = this.#known ?? {};
    if (!by || !poses?.length) return null;
    const count = pairs?.filter(({ file, pose }) => file !== null && pose !== null).length ?? 0;
    return h("p", {}, mark("pass", t(count === 1 ? "files.pair_one" : "files.pair_many", { count, by: t(`files.by_${by}`) })), " ",
      convention && h("span", { class: "soft" }, t("files.convention", { name: maybe(`convention.${convention.name}`, convention.name) })));
  }

  /** @param {string} name @param {string} kind */
  async #tell(name, kind) {
    this.#told[name] = kind;
    await this.#look();
    this.changed();
  }
}

/** How many files are what. @param {readonly RecognisedFile[]} files */
function summary(files) {
  const counts = new Map();
  for (const { taken_for: kind } of files) counts.set(kind, (counts.get(kind) ?? 0) + 1);
  const parts = [...counts].map(([kind, count]) => (kind === "nothing" ? t("files.unused", { count }) : `${count} ${maybe(`files.${kind}`, kind)}`));
  return t(files.length === 1 ? "files.came_one" : "files.came_many", { count: files.length, parts: parts.join(", ") });
}

/** Why; here some say what to do on this page. @param {Why} given */
const why = ({ reason, values, why: sentence }) => maybe(`files.why_${reason}`, said(sentence), /** @type {Record<string, string | number>} */ (values));

/** @param {string | undefined} path */
const stem = (path) => path?.split("/").at(-1)?.replace(/\.[^.]+$/, "") ?? "";

/** A name that a line can begin with. @param {ReadonlyMap<string, unknown>} taken @param {string} name */
function freeName(taken, name) {
  const plain = name.replace(/[^A-Za-z0-9_.-]+/g, "_").replace(/^_+|_+$/g, "").replace(/^([^A-Za-z])/, "p$1") || "p";
  for (let number = 1; ; number++) {
    const free = number === 1 ? plain : `${plain}-${number}`;
    if (!taken.has(free)) return free;
  }
}

customElements.define("sc-file-list", FileListElement);
