// A controller's files among those that came: their tools, the axis that turns the table, what was left out, what is open.

import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { mark } from "../icons.js";
import { remember } from "../state/backups.js";
import { proofWords, registry } from "../state/registries.js";
import { plural, said, t } from "../texts.js";

/** @import {Found} from "../state/files.js" */
/** @import {ControllerFile} from "../state/model.js" */

export class PoseFileElement extends HTMLElement {
  /** Called when another axis is the table's. @type {() => void} */ changed = () => undefined;
  /** @type {ControllerFile | null} */ #read = null;
  /** Whose they are, and what proved their reader. */ #brand = "";
  #axis = h("select", { onchange: () => this.changed() });

  /**
   * Read files and show what they hold.
   * @param {string} sessionId
   * @param {readonly Found[]} found
   * @param {unknown} [arm] the cell's: joints beside the poses are asked whose these are where it is known by name
   */
  async take(sessionId, found, arm) {
    this.#read = await api.readControllerFiles(found, typeof arm === "string" ? arm : "");
    const packed = found.filter(({ path }) => path.toLowerCase().endsWith(".zip")).map(({ path }) => path);
    const used = new Set([...this.#read.files, ...packed]);
    const { brand } = this.#read;
    const proof = (await registry("brands")).find(({ name, title }) => brand === name || brand === title)?.proof;
    this.#brand = proof ? t("proof.beside", { what: brand, proof: proofWords(proof) }) : brand;
    remember(sessionId, { found: found.filter(({ path }) => used.has(path)), content: this.#read });
    this.#draw();
  }

  clear() {
    this.#read = null;
    this.replaceChildren();
  }

  /** The table's angle of the pose in a line of a file, where an external axis turns it. @param {string} file @param {number} line */
  angleAt(file, line) {
    return this.#read?.poses.find((pose) => pose.file === file && pose.line === line)?.external?.[this.#axis.value];
  }

  #draw() {
    if (!this.#read) return;
    const { poses, tools, skipped, notes } = this.#read;
    const axes = [...new Set(poses.flatMap(({ external }) => Object.keys(external ?? {})))];
    const turning = axes.find((axis) => new Set(poses.map(({ external }) => external?.[axis])).size > 1);
    this.#axis.replaceChildren(h("option", { value: "" }, t("pose_file.no_axis")), ...axes.map((axis) => h("option", { value: axis, selected: axis === turning }, axis)));
    const doubts = [...new Set([...poses.flatMap(({ doubt }) => (doubt ? [doubt] : [])), ...notes])];
    this.replaceChildren(h("section", { class: "pose-file", "aria-label": t("pose_file.label") },
      h("p", {}, mark(doubts.length ? "warn" : "pass", t("pose_file.read", { brand: this.#brand, poses: plural(poses.filter(({ pose }) => pose).length, "pose_file.pose_one", "pose_file.pose_many"), tools: tools.length }))),
      axes.length > 0 && field("pose-file-axis", t("pose_file.axis"), this.#axis),
      doubts.length > 0 && h("ul", { class: "messages" }, ...doubts.map((doubt) => h("li", {}, said(doubt)))),
      skipped.length > 0 && h("details", {}, h("summary", {}, plural(skipped.length, "pose_file.skipped_one", "pose_file.skipped_many")),
        h("ul", {}, ...skipped.map(({ file, line, reason }) => h("li", {}, `${file ?? ""}:${line}: ${said(reason)}`))))));
  }
}

customElements.define("sc-pose-file", PoseFileElement);
