// A controller's file among the files that came: the poses read from it, what was left out, what is open about them.

import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { mark } from "../icons.js";
import { remember } from "../state/backups.js";
import { plural, said, t } from "../texts.js";

/** @import {Found} from "../state/files.js" */
/** @import {Capture, ControllerFile, FilePose, PoseConvention} from "../state/model.js" */

export class PoseFileElement extends HTMLElement {
  /** Called when another axis is the table's. @type {() => void} */ changed = () => undefined;
  /** @type {ControllerFile | null} */ #read = null;
  /** By the name that its line begins with. @type {Map<string, FilePose>} */ #poses = new Map();
  #axis = h("select", { onchange: () => this.changed() });

  /**
   * Read files and show what they hold.
   * @param {string} sessionId
   * @param {readonly Found[]} found
   * @param {unknown} [arm] the cell's: joints beside the poses are asked whose these are where it is known by name
   * @returns {Promise<Set<string>>} the paths of those that are a controller's
   */
  async take(sessionId, found, arm) {
    this.#read = await api.readControllerFiles(found, typeof arm === "string" ? arm : "");
    this.#poses = new Map();
    for (const pose of this.#read.poses) if (pose.pose) this.#poses.set(freeName(this.#poses, pose.name), pose);
    const packed = found.filter(({ path }) => path.toLowerCase().endsWith(".zip")).map(({ path }) => path);
    const used = new Set([...this.#read.files, ...packed]);
    remember(sessionId, { found: found.filter(({ path }) => used.has(path)), content: this.#read });
    this.#draw();
    return used;
  }

  clear() {
    this.#read = null;
    this.#poses = new Map();
    this.replaceChildren();
  }

  /** A line for each pose, as the server reads them. */
  get lines() {
    return [...this.#poses].map(([name, { pose }]) => [name, ...pose ?? []].join(" ")).join("\n");
  }

  /** @returns {PoseConvention | null} */
  get convention() {
    const [first] = this.#poses.values();
    return first ? /** @type {PoseConvention} */ (first.convention) : null;
  }

  /** What a capture's record keeps of the pose that a line stands for: where it stands, its joints and time. @param {string} line @returns {Partial<Capture>} */
  recordOf(line) {
    const pose = this.#of(line);
    if (!pose) return {};
    return { source: `${pose.file ?? ""}:${pose.line}`, ...(pose.joints_deg ? { joints_deg: pose.joints_deg } : {}), ...(pose.time_s === null ? {} : { device_time_s: pose.time_s }) };
  }

  /** The table's angle, where an external axis turns it. @param {string} line */
  angleOf(line) {
    return this.#of(line)?.external?.[this.#axis.value];
  }

  /** @param {string} line */
  #of(line) {
    return this.#poses.get(line.trim().split(/\s+/, 1)[0] ?? "");
  }

  #draw() {
    if (!this.#read) return;
    const { brand, poses, tools, skipped, notes } = this.#read;
    const axes = [...new Set(poses.flatMap(({ external }) => Object.keys(external ?? {})))];
    const turning = axes.find((axis) => new Set(poses.map(({ external }) => external?.[axis])).size > 1);
    this.#axis.replaceChildren(h("option", { value: "" }, t("pose_file.no_axis")), ...axes.map((axis) => h("option", { value: axis, selected: axis === turning }, axis)));
    const doubts = [...new Set([...poses.flatMap(({ doubt }) => (doubt ? [doubt] : [])), ...notes])];
    this.replaceChildren(h("section", { class: "pose-file", "aria-label": t("pose_file.label") },
      h("p", {}, mark(doubts.length ? "warn" : "pass", t("pose_file.read", { brand, poses: plural(this.#poses.size, "pose_file.pose_one", "pose_file.pose_many"), tools: tools.length }))),
      axes.length > 0 && field("pose-file-axis", t("pose_file.axis"), this.#axis),
      doubts.length > 0 && h("ul", { class: "messages" }, ...doubts.map((doubt) => h("li", {}, said(doubt)))),
      skipped.length > 0 && h("details", {}, h("summary", {}, plural(skipped.length, "pose_file.skipped_one", "pose_file.skipped_many")),
        h("ul", {}, ...skipped.map(({ file, line, reason }) => h("li", {}, `${file ?? ""}:${line}: ${said(reason)}`))))));
  }
}

/** A name that a line can begin with. @param {ReadonlyMap<string, unknown>} taken @param {string} name */
function freeName(taken, name) {
  const plain = name.replace(/[^A-Za-z0-9_.-]+/g, "_").replace(/^_+|_+$/g, "").replace(/^([^A-Za-z])/, "p$1") || "p";
  for (let number = 1; ; number++) {
    const free = number === 1 ? plain : `${plain}-${number}`;
    if (!taken.has(free)) return free;
  }
}

customElements.define("sc-pose-file", PoseFileElement);
