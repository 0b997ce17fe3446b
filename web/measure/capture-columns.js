// The columns of a table of captures: those that its captures have something to say in, whatever their step.

import { h } from "../dom.js";
import { fixed, forController, integer, small } from "../format.js";
import { mark } from "../icons.js";
import { maybe, said, t } from "../texts.js";
import { thumbnail } from "./thumbnail.js";

/** @import {CaptureOut, Residual as Told} from "../state/model.js" */
/** What a result says of a capture, and whether it is one of boards. @typedef {Told & { ofFrames?: boolean }} Residual */
/** @typedef {(capture: CaptureOut, residual: Residual | undefined) => string | number | null} Value */
/**
 * @typedef {object} Column
 * @property {string} name
 * @property {string} title
 * @property {string} [hint]
 * @property {boolean} [right]
 * @property {Value} value what it is sorted and copied by
 * @property {(capture: CaptureOut, residual: Residual | undefined) => Node | string | null} cell
 */

/** @param {unknown} value */
const number = (value) => (typeof value === "number" ? value : null);
/** A column of plain numbers. @param {string} name @param {Value} value @param {(value: number) => string} words @returns {Column} */
const plain = (name, value, words) => ({
  name, title: maybe(`column.${name}`, name), right: true, value,
  cell: (capture, residual) => { const found = value(capture, residual); return typeof found === "number" ? words(found) : "–"; },
});

/** @type {readonly Column[]} */
const COLUMNS = [
  { name: "id", title: t("column.id"), value: ({ id }) => id, cell: ({ id }) => id },
  { name: "state", title: t("column.state"), value: (capture, residual) => statusOf(capture, residual)[1], cell: (capture, residual) => status(capture, residual) },
  { name: "scanner", title: t("chain.scanner"), value: ({ scanner }) => scanner ?? null, cell: ({ scanner }) => scanner ?? "–" },
  { name: "table", title: t("column.table"), right: true, value: (capture) => number(capture.table_deg) ?? (capture.mount && axes(capture) === null ? "" : null), cell: place },
  { name: "axes", title: t("column.axes"), value: axes, cell: (capture) => axes(capture) ?? "–" },
  { name: "pose", title: t("column.pose"), value: ({ pose, measured }) => pose?.join(" ") ?? (measured.image_size ? null : ""), cell: (capture, residual) => poseCell(capture, residual) },
  { ...plain("zone", ({ measured }) => number(measured.zone), (value) => fixed(value, 2)), hint: t("glossary.words_zone") },
  plain("extent", ({ measured }) => number(measured.extent_deg), (value) => `${fixed(value, 0)}°`),
  plain("points", ({ measured }) => number(measured.on_sphere) || number(measured.points), integer),
  plain("edge", ({ measured }) => number(measured.edge_width_px), (value) => `${fixed(value, 1)} px`),
  plain("rms", ({ measured }, residual) => number(residual?.surface_rms_mm) ?? number(residual?.line_rms_mm) ?? number(measured.rms_mm), small),
  plain("rms_px", (_, residual) => number(residual?.rms_px), (value) => `${fixed(value, 2)} px`),
  plain("off", (_, residual) => number(residual?.mahalanobis), (value) => `${fixed(value, 1)} σ`),
];

/**
 * @param {readonly CaptureOut[]} captures
 * @param {ReadonlyMap<string, Residual>} residuals
 * @returns {Column[]}
 */
export function columnsFor(captures, residuals) {
  return COLUMNS.filter(({ value }) => captures.some((capture) => value(capture, residuals.get(capture.id)) !== null));
}

/** @param {CaptureOut} capture */
columnsFor.picture = (capture) => (capture.measured.preview ?? []).length > 0 && thumbnail(capture);

/** Where axes stood that the cell names, and which ball they carried. @param {CaptureOut} capture */
function axes({ axes_deg, axes_mm, mount }) {
  const turns = Object.entries(axes_deg ?? {}).map(([name, value]) => `${name} ${fixed(Number(value), 2)}°`);
  const shifts = Object.entries(axes_mm ?? {}).map(([name, value]) => `${name} ${fixed(Number(value), 2)} mm`);
  return turns.length + shifts.length ? [...turns, ...shifts, mount].filter(Boolean).join(" · ") : null;
}

/** @param {CaptureOut} capture */
function place({ table_deg, mount }) {
  const angle = typeof table_deg === "number" ? `${fixed(table_deg, Number.isInteger(table_deg) ? 0 : 3)}°` : t("captures.no_angle");
  return mount ? `${angle} · ${mount}` : angle;
}

/** @param {CaptureOut} capture @param {Residual | undefined} residual */
function poseCell({ pose }, residual) {
  const numbers = pose?.map((value) => forController(value, Math.abs(value) < 4 ? 3 : 1)).join("  ");
  return h("span", {}, numbers ? h("span", { class: "number", title: pose?.join(" ") ?? "" }, numbers) : h("span", { class: "soft" }, t("captures.no_pose")),
    residual?.used === false && residual.reason && h("span", { class: "why", title: said(residual.reason) }, said(residual.reason)));
}

/**
 * @param {CaptureOut} capture
 * @param {Residual | undefined} residual
 */
export const status = (capture, residual) => mark(...statusOf(capture, residual));

/**
 * The sign and the words of what became of a capture.
 * @param {CaptureOut} capture
 * @param {Residual | undefined} residual
 * @returns {[string, string]}
 */
export function statusOf(capture, residual) {
  const { verdict } = capture.measured;
  if (capture.excluded) return ["skipped", t("captures.excluded")];
  // What is no frame is not rejected where boards are seen, but not needed.
  if (residual?.used === false && residual.ofFrames && capture.kind !== "frame") return ["skipped", t("status.not-needed")];
  if (residual?.used === false) return verdict === "fail" ? ["fail", t("quality.fail")] : ["warn", t("captures.rejected")];
  if (residual) return ["pass", t("captures.used")];
  return [verdict, maybe(`quality.${verdict}`, verdict)];
}
