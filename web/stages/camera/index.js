// What the camera draws itself: each view's residuals as arrows, one view at a time or all laid over each other.

import { h, s } from "../../dom.js";
import { fixed } from "../../format.js";
import { t } from "../../texts.js";

/** @import {Context} from "../../blocks/index.js" */
/** @import {Block, CameraResult} from "../../state/model.js" */
/** @typedef {CameraResult["residuals"][number]} View */

export const elements = {
  blocks: {
    /** @param {Block} _ @param {Context} context */
    "camera-residuals": (_, { state, stage }) => arrows(/** @type {CameraResult} */ (/** @type {unknown} */ (state.results[stage])), state.selected),
  },
};

/** @param {CameraResult} result @param {string | null} selected */
function arrows({ residuals, image_size, reprojection_rms_px }, selected) {
  const views = residuals.filter((view) => (view.points_px ?? []).length > 0);
  const first = views.find((view) => view.capture === selected);
  const [width = 1, height = 1] = image_size.map(Number);
  const times = 10 ** Math.max(0, Math.floor(Math.log10(Math.max(width, height) / 12 / Math.max(3 * reprojection_rms_px, 1e-3))));
  const picture = h("div", {});
  const show = (/** @type {View | undefined} */ view) => {
    const label = view ? t("camera.view_label", { capture: view.capture, corners: view.corners ?? 0, rms: fixed(view.rms_px ?? 0, 3) }) : t("camera.all_views", { views: views.length });
    picture.replaceChildren(arrowsOf(view ? [view] : views.filter(({ used }) => used), width, height, times, label));
  };
  const select = h("select", { id: "camera-view", onchange: () => show(views.find((view) => view.capture === select.value)) },
    h("option", { value: "" }, t("camera.all_views", { views: views.length })),
    ...views.map((view) => h("option", { value: view.capture, selected: view === first }, `${view.capture} · ${fixed(view.rms_px ?? 0, 3)} px${view.used ? "" : ` · ${t("captures.rejected")}`}`)));
  show(first);
  return h("div", { class: "arrows-block" }, h("p", { class: "soft small" }, t("camera.arrows_what", { times })),
    h("div", { class: "field" }, h("label", { for: "camera-view" }, t("camera.view")), select), picture);
}

/** @param {View[]} views @param {number} width @param {number} height @param {number} times @param {string} label */
function arrowsOf(views, width, height, times, label) {
  const size = Math.max(width, height) / 200;
  const path = views.map(({ points_px: points = [], residuals_px: residuals = [] }) => points.map(([x, y], index) =>
    `M${x} ${y}l${((residuals[index]?.[0] ?? 0) * times).toFixed(1)} ${((residuals[index]?.[1] ?? 0) * times).toFixed(1)}`).join("")).join("");
  const corners = views.map(({ points_px: points = [] }) => points.map(([x, y]) => `M${x} ${y}h0`).join("")).join("");
  return s("svg", { class: "arrows", viewBox: `-0.5 -0.5 ${width} ${height}`, role: "img", "aria-label": label },
    s("path", { class: "arrow", "stroke-width": size * 0.6, d: path }), s("path", { class: "corner", "stroke-width": size * 1.4, d: corners }));
}
