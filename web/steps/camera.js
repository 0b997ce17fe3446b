// The camera: the model and why it was chosen, its numbers, where boards were seen, and the arrows of each view.

import { h, s } from "../dom.js";
import { fixed, measured, significant } from "../format.js";
import { mark } from "../icons.js";
import { t } from "../texts.js";
import { banner, K, pair, rawNumbers, verdictWord } from "./parts.js";

/** @import {CameraResult, StageResult} from "../model.js" */
/** @import {SessionState} from "../state.js" */
/** @typedef {CameraResult["residuals"][number]} View */

const DEGREE = Math.PI / 180;

/** @param {CameraResult} result */
function summary(result) {
  return [h(
    "div", { class: "answer" },
    h("h3", {}, t("step.camera"), " ", mark(result.stale ? "stale" : result.verdict, verdictWord(result))),
    h("p", { class: "number" }, `${fixed(result.reprojection_rms_px, 3)} px`),
    h("p", { class: "small soft" }, t(`camera.${result.model}`)),
  )];
}

/** @param {CameraResult} result @param {SessionState} state */
function sections(result, state) {
  return [
    banner(result, t("step.camera")),
    h("div", { class: "result-pair" }, numbers(result), coverage(result)),
    candidates(result),
    arrows(result, state),
    rawNumbers(result, result.camera_matrix, t("camera.raw")),
  ];
}

/** The standard deviation of a parameter; null where the model has none of that name. @param {CameraResult} result @param {string} name */
function sigmaOf({ parameters, covariance }, name) {
  const index = parameters.indexOf(name);
  return index < 0 ? null : Math.sqrt(Math.max(covariance[index]?.[index] ?? 0, 0));
}

/** @param {CameraResult} result */
function numbers(result) {
  const matrix = result.camera_matrix;
  const row = (/** @type {string} */ title, /** @type {number | undefined} */ value, /** @type {string} */ name) =>
    pair(title, measured(value ?? 0, (sigmaOf(result, name) ?? 0) * K, "px"));
  return h(
    "section", { class: "panel", "aria-labelledby": "camera-title" },
    h("h2", { id: "camera-title" }, t("camera.numbers")),
    h("dl", { class: "pairs number" },
      row(t("camera.focal", { axis: "x" }), matrix[0]?.[0], "fx"), row(t("camera.focal", { axis: "y" }), matrix[1]?.[1], "fy"),
      row(t("camera.principal", { axis: "x" }), matrix[0]?.[2], "cx"), row(t("camera.principal", { axis: "y" }), matrix[1]?.[2], "cy"),
      ...Object.entries(result.distortion).filter(([name]) => !name.startsWith("tau")).map(([name, value]) => pair(name, measured(value, (sigmaOf(result, name) ?? 0) * K, ""))),
      result.model === "tilted" ? pair(t("camera.tilt"), result.tilt_rad.map((angle) => `${fixed(angle / DEGREE, 3)}°`).join("  ")) : pair(t("camera.model"), t(`camera.${result.model}`)),
      ...(typeof result.tilt_correlation === "number" ? [pair(t("camera.tilt_correlation"), fixed(result.tilt_correlation, 2))] : []),
      pair(t("camera.rms"), `${fixed(result.reprojection_rms_px, 3)} px`),
      pair(t("camera.corner"), `${fixed(result.corner_sigma_px, 3)} px`),
      pair(t("evidence.captures"), t("evidence.used_of", { used: result.residuals.filter((view) => view.used).length, all: result.residuals.length })),
    ),
  );
}

/** @param {CameraResult} result */
function coverage({ coverage: seen, image_size }) {
  const [width, height] = image_size.map(Number);
  const most = Math.max(1, ...seen.counts.flat());
  const cells = seen.counts.flatMap((row, y) => row.map((count, x) =>
    s("rect", { class: count ? "cell" : "cell empty", x, y, width: 1, height: 1, "fill-opacity": count ? (0.15 + 0.85 * Math.sqrt(count / most)).toFixed(2) : 1 }, s("title", {}, String(count)))));
  const columns = seen.counts[0]?.length ?? 1;
  const label = t("camera.coverage_label", { rows: seen.counts.map((row) => row.join(" ")).join("; ") });
  return h(
    "section", { class: "panel", "aria-labelledby": "coverage-title" },
    h("h2", { id: "coverage-title" }, t("camera.coverage")),
    s("svg", { class: "coverage", viewBox: `0 0 ${columns} ${seen.counts.length}`, preserveAspectRatio: "none", style: `aspect-ratio: ${width} / ${height}`, role: "img", "aria-label": label }, ...cells),
    h("p", { class: "small soft" }, t("camera.coverage_words", {
      share: fixed(seen.covered * 100, 0), near: fixed(seen.near_mm, 0), far: fixed(seen.far_mm, 0), tilt: fixed(seen.largest_tilt_rad / DEGREE, 0),
    })),
  );
}

/** @param {CameraResult} result */
function candidates({ candidates: all = [], model }) {
  if (!all.length) return null;
  const heads = [t("camera.candidate"), t("camera.parameters"), t("camera.held_out"), ""];
  return h(
    "section", { class: "panel", "aria-labelledby": "model-title" },
    h("h2", { id: "model-title" }, t("camera.why")),
    h("p", { class: "soft small" }, t("camera.why_words")),
    h("table", { class: "number compare" },
      h("thead", {}, h("tr", {}, ...heads.map((head, index) => h(head ? "th" : "td", { ...(head ? { scope: "col" } : {}), class: index > 0 && "right" }, head)))),
      h("tbody", {}, ...all.map((one) => h("tr", {},
        h("th", { scope: "row" }, one.model), h("td", { class: "right" }, String(one.parameters)),
        h("td", { class: "right" }, `${significant(one.held_out_rms_px, 3)} px`), h("td", { class: "right" }, one.model === model && mark("pass", t("camera.chosen"))))))),
  );
}

/** @param {CameraResult} result @param {SessionState} state */
function arrows(result, state) {
  const views = result.residuals.filter((view) => (view.points_px ?? []).length > 0);
  const first = views.find((view) => view.capture === state.selected) ?? views[0];
  const [width, height] = result.image_size.map(Number);
  const size = Math.max(width ?? 1, height ?? 1);
  const times = 10 ** Math.max(0, Math.floor(Math.log10(size / 12 / Math.max(3 * result.reprojection_rms_px, 1e-3))));
  const picture = h("div", {});
  const show = (/** @type {View | undefined} */ view) => picture.replaceChildren(view ? arrowsOf(view, width ?? 1, height ?? 1, times) : h("p", { class: "soft" }, t("camera.no_view")));
  const select = h("select", { id: "camera-view", onchange: () => show(views.find((view) => view.capture === select.value)) },
    ...views.map((view) => h("option", { value: view.capture, selected: view === first }, `${view.capture} · ${fixed(view.rms_px ?? 0, 3)} px${view.used ? "" : ` · ${t("captures.rejected")}`}`)));
  show(first);
  return h(
    "section", { class: "panel", "aria-labelledby": "arrows-title" },
    h("h2", { id: "arrows-title" }, t("camera.arrows")),
    h("p", { class: "soft small" }, t("camera.arrows_what", { times })),
    h("div", { class: "field" }, h("label", { for: "camera-view" }, t("camera.view")), select),
    picture,
  );
}

/** @param {View} view @param {number} width @param {number} height @param {number} times */
function arrowsOf({ capture, points_px: points = [], residuals_px: residuals = [], corners, rms_px }, width, height, times) {
  const size = Math.max(width, height) / 200;
  const path = points.map(([x, y], index) => `M${x} ${y}l${fixedPlain((residuals[index]?.[0] ?? 0) * times)} ${fixedPlain((residuals[index]?.[1] ?? 0) * times)}`);
  return s(
    "svg", { class: "arrows", viewBox: `-0.5 -0.5 ${width} ${height}`, role: "img", "aria-label": t("camera.view_label", { capture, corners: corners ?? points.length, rms: fixed(rms_px ?? 0, 3) }) },
    s("path", { class: "arrow", "stroke-width": size * 0.6, d: path.join("") }),
    ...points.map(([x, y]) => s("circle", { class: "corner", cx: x, cy: y, r: size * 0.7 })),
  );
}

/** @param {number} value */
const fixedPlain = (value) => value.toFixed(1);

/** @type {import("./index.js").StepPage} */
export const camera = {
  summary: (/** @type {StageResult} */ result) => summary(/** @type {CameraResult} */ (result)),
  result: (result, state) => sections(/** @type {CameraResult} */ (result), state),
};
