// What the merge draws itself: the files to download, the settings to merge with again, and looking into the cloud.

import { api } from "../../state/api.js";
import { h, make, style } from "../../dom.js";
import { registry } from "../../state/registries.js";
import { t } from "../../texts.js";
import { later } from "../../components/lazy-parts.js";
import { attempt } from "../../components/toasts.js";

/** @import {Context} from "../../blocks/index.js" */
/** @import {MergeResult} from "../../state/model.js" */

style("merged");

export const elements = {
  /** @param {Context} context @param {import("../../result/result.js").Keep} keep */
  after: ({ state, stage }, keep) => {
    const result = /** @type {MergeResult} */ (/** @type {unknown} */ (state.results[stage]));
    return [files(result, state.id), ...(result.cloud ? [keep("merged", () => later(async () => make((await import("./merged.js")).MergedElement, { state, stage })))] : [])];
  },
};

const IN_FRAME = /** @type {const} */ ({ turntable: "merge.in_table", base: "merge.in_base", tool0: "merge.in_flange" });

/** @param {MergeResult} result @param {string} sessionId */
function files(result, sessionId) {
  const link = (/** @type {string} */ stem, /** @type {string} */ format) =>
    h("a", { class: "file", href: api.cloudAddress(sessionId, `${stem}.${format}`), download: `${sessionId}-${stem}.${format}` }, format.toUpperCase());
  const row = (/** @type {string} */ name, /** @type {string} */ stem, /** @type {string} */ what) => {
    const made = h("div", { class: "files-row" }, h("h3", {}, name));
    void attempt(async () => made.append(...(await registry("formats")).filter(({ writes }) => writes.includes(what)).map((format) => link(stem, format.name))));
    return made;
  };
  return h(
    "section", { class: "panel", "aria-labelledby": "merge-files" },
    h("h2", { id: "merge-files" }, t("merge.files")),
    result.cloud ? row(t("merge.cloud"), "merged", "cloud") : h("p", {}, t("merge.no_cloud")),
    result.mesh && row(t("merge.mesh_file"), "mesh", "mesh"),
    h("p", { class: "soft small" }, t(IN_FRAME[result.frame]), " ", t("merge.units")));
}
