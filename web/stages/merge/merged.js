// Looking into the merged cloud: colours, sections, deviations. What is set here is seen in the scene, too.

import "../../texts/later.js";
import { api } from "../../state/api.js";
import { Problem } from "../../state/http.js";
import { field, h, putChildren } from "../../dom.js";
import { fixed, inField, integer, small, typedNumber } from "../../format.js";
import { mark } from "../../icons.js";
import { may } from "../../state/me.js";
import { said, t } from "../../texts.js";
import { StateElement } from "../../components/base.js";
import { histogramPlot, sectionPlot } from "./section-plot.js";
import { attempt, say } from "../../components/toasts.js";

/** @import {CloudView, MergeResult} from "../../state/model.js" */

const COLORS = /** @type {const} */ (["height", "scan", "intensity", "deviation"]);
const AXES = /** @type {const} */ (["", "x", "y", "z", "plane"]);
const BANDS = /** @type {const} */ (["within", "above", "below"]);
const SETTLE_MS = 120;
const STEPS = 400;

/** What clicks in section and scene do, and how many make it whole. */
const CLICKS = /** @type {const} */ ({ measure: 2, datum: 6, feature: 12, plane: 3 });
/** @typedef {keyof typeof CLICKS} Click */
/** @typedef {readonly number[]} Point in the cloud's frame, mm */

/** How each session's cloud was looked at last: the page may be left and come back to. @type {Map<string, CloudView>} */
const views = new Map();

const FEATURES = /** @type {const} */ (["plane", "sphere"]);
/** What a datum feature is, by the point that was picked on it. @type {WeakMap<Point, {kind: "plane" | "sphere", radius_mm: number}>} */
const features = new WeakMap();

/** What was picked, by session: the page may be left and come back to. @type {Map<string, Record<Click, Point[]>>} */
const picks = new Map();

export class MergedElement extends StateElement {
  stage = "";
  #timer = 0;
  #asked = 0;
  #colors = COLORS.map((color) => h("input", { type: "radio", name: "cloud-colors", value: color, id: `cloud-${color}`, onchange: () => this.#changed() }));
  #axis = h("select", { onchange: () => this.#changed() }, ...AXES.map((axis) => h("option", { value: axis, hidden: axis === "plane" }, axis === "plane" ? t("merged.across_plane") : axis ? t("merged.across", { axis }) : t("merged.no_section"))));
  #at = h("input", { type: "range", id: "cloud-at", oninput: () => this.#changed() });
  #place = h("output", { for: "cloud-at", class: "number" });
  #keep = h("input", { type: "checkbox", id: "cloud-keep", onchange: () => this.#changed() });
  #against = h("select", { onchange: () => this.#changed() }, h("option", { value: "mesh" }, t("merged.mesh")), h("option", { value: "sphere" }, t("merged.sphere")));
  #diameter = h("input", { inputmode: "decimal", autocomplete: "off", oninput: () => this.#changed() });
  #file = h("input", { type: "file", accept: ".stl,.ply,.obj", class: "visually-hidden", tabindex: -1, "aria-label": t("merged.add"), onchange: () => void this.#upload() });
  #add = h("button", { type: "button", needs: "capture", onclick: () => this.#file.click() }, t("merged.add"));
  #forget = h("button", { type: "button", class: "plain", needs: "capture", hidden: true, onclick: () => void this.#remove() }, t("merged.remove"));
  #cut = h("div", { class: "field cut" }, h("label", { for: "cloud-at" }, t("merged.where")), h("div", { class: "row" }, this.#at, this.#place), h("div", { class: "row" }, this.#keep, h("label", { for: "cloud-keep" }, t("merged.other_side"))));
  #known = field("cloud-diameter", t("merged.diameter"), this.#diameter, t("merged.diameter_hint"));
  #reference = h("div", { class: "field" }, h("div", { class: "row" }, this.#add, this.#forget, this.#file), h("span", { class: "hint" }, t("merged.mesh_hint")));
  #compared = field("cloud-against", t("merged.against"), this.#against);
  #section = h("div", { class: "merged-answer" });
  #picked = h("div", { class: "merged-answer", "aria-live": "polite" });
  #clicks = h("select", { onchange: () => this.#mark() }, ...Object.keys(CLICKS).map((click) => h("option", { value: click }, t(/** @type {"merged.click_measure"} */ (`merged.click_${click}`)))));
  #clicking = field("cloud-clicks", t("merged.click"), this.#clicks);
  /** What the section's plot shows. @type {(() => void) | null} */
  #drawSlab = null;
  /** Where the keys aim in the section. @type {import("./section-plot.js").Aim} */ #aim = { at: null };
  /** The normal of a plane that was picked. @type {Point | null} */
  #normal = null;
  /** @type {Point | null} */ #heard = null;
  #deviation = h("div", { class: "merged-answer", "aria-live": "polite" });

  /** The result that is shown. */ #shown = "";

  parts = /** @type {const} */ (["results", "surface", "scene"]);

  build() {
    const view = this.#view;
    for (const input of this.#colors) input.checked = input.value === view.colors;
    this.#normal = view.normal;
    this.#axis.value = view.axis;
    this.#against.value = view.against;
    this.#keep.checked = view.keep === "above";
    this.#diameter.value = String(inField(view.diameter_mm));
    this.append(h(
      "section", { class: "panel", "aria-labelledby": "merged-title" },
      h("h2", { id: "merged-title" }, t("merged.title")),
      h("p", { class: "soft small" }, t("merged.what")),
      h("fieldset", { class: "row choices" }, h("legend", {}, t("merged.colors")), ...this.#colors.map((input) => h("span", {}, input, h("label", { for: input.id }, t(/** @type {"merged.height"} */ (`merged.${input.value}`)))))),
      this.#compared, this.#known, this.#reference, this.#deviation,
      field("cloud-axis", t("merged.section"), this.#axis), this.#cut, this.#section, this.#clicking, this.#picked,
    ));
  }

  connectedCallback() {
    this.#heard = this.state.surface; // what was clicked before is no click now
    super.connectedCallback();
  }

  /** A new result is looked at as the one before; a scene that comes later, or anew, is told. @param {ReadonlySet<import("../../state/session.js").Part>} changed */
  update(changed) {
    if (changed.has("scene") && this.#shown) this.#tellScene();
    const { surface } = this.state;
    if (surface && surface !== this.#heard) {
      this.#heard = surface;
      this.#pick(surface);
    }
    const now = this.#merge?.inputs_sha256;
    if (!now || now === this.#shown) return;
    this.#shown = now;
    for (const input of this.#colors) {
      if (input.value === "intensity" && input.parentElement) input.parentElement.hidden = !this.#merge?.with_intensity;
    }
    this.#reach();
    this.#changed();
    this.#drawPicked();
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.#shown = "";
    window.clearTimeout(this.#timer);
  }

  /** @returns {CloudView} */
  get #view() {
    const { low } = this.#ends();
    return views.get(this.state.id) ?? { colors: "height", axis: "", normal: null, at_mm: low, keep: "below", against: "mesh", diameter_mm: null };
  }

  /** Where the cloud begins and ends along the axis or normal that is chosen. */
  #ends() {
    const normal = this.#axis.value === "plane" && this.#normal ? this.#normal : ["x", "y", "z"].map((axis) => Number(axis === (this.#axis.value || "x")));
    const { low_mm, high_mm } = this.#merge ?? { low_mm: [0, 0, 0], high_mm: [1, 1, 1] };
    const sum = (/** @type {(low: number, high: number) => number} */ pick) =>
      normal.reduce((all, part, axis) => all + pick(part * (low_mm[axis] ?? 0), part * (high_mm[axis] ?? 0)), 0);
    return { low: sum(Math.min), high: sum(Math.max) };
  }

  /** What was picked in this session. */
  get #picks() {
    const known = picks.get(this.state.id) ?? { measure: [], datum: [], feature: [], plane: [] };
    picks.set(this.state.id, known);
    return known;
  }

  /** What a click does now. */
  get #click() {
    return /** @type {Click} */ (this.#clicks.value);
  }

  /** Let the slider reach from one end of the cloud to the other. */
  #reach() {
    const { low, high } = this.#ends();
    Object.assign(this.#at, { min: String(low), max: String(high), step: String((high - low) / STEPS) });
    const { axis, at_mm } = this.#view;
    this.#at.value = String(axis === this.#axis.value && axis ? at_mm : (low + high) / 2);
  }

  #changed() {
    const view = this.#view;
    const axis = AXES.find((one) => one === this.#axis.value) ?? "";
    if (axis !== view.axis) this.#reach();
    const typed = typedNumber(this.#diameter.value);
    const next = {
      colors: COLORS.find((color) => this.#colors.some((input) => input.checked && input.value === color)) ?? "height",
      axis, normal: this.#normal, at_mm: Number(this.#at.value), keep: /** @type {"below" | "above"} */ (this.#keep.checked ? "above" : "below"),
      against: /** @type {"mesh" | "sphere"} */ (this.#against.value), diameter_mm: typed > 0 ? typed : null,
    };
    views.set(this.state.id, next);
    this.#cut.hidden = axis === "";
    this.#place.textContent = `${fixed(next.at_mm, 1)} mm`;
    const compares = next.colors === "deviation";
    this.#compared.hidden = !compares;
    this.#known.hidden = !compares || next.against !== "sphere";
    this.#reference.hidden = !compares || next.against !== "mesh";
    window.clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => void this.#show(next), SETTLE_MS);
  }

  /** @param {CloudView} view */
  async #show(view) {
    const asked = ++this.#asked;
    // The scene is an extra: where it does not answer, section and deviations are still here.
    this.#tellScene();
    const known = view.colors !== "deviation" || view.against === "sphere" || await api.hasReference(this.state.id).catch(() => false);
    this.#forget.hidden = view.against !== "mesh" || !known || !may("capture");
    const [deviation, section] = await Promise.all([
      known ? this.#deviations(view) : [h("p", {}, t("merged.no_mesh"))],
      this.#slice(known ? view : { ...view, colors: "height" }),
    ]);
    if (asked !== this.#asked) return;
    putChildren(this.#deviation, deviation);
    putChildren(this.#section, section);
  }

  /** @param {CloudView} view @returns {Promise<Node[]>} */
  async #deviations(view) {
    if (view.colors !== "deviation") return [];
    const found = await api.cloudDeviations(this.state.id, view).catch(refused);
    if (found instanceof Problem) return [mark("warn", found.message)];
    const pairs = /** @type {const} */ ([["glossary.term_rms", found.rms_mm], ["merged.mean", found.mean_mm], ["merged.p95", found.p95_mm], ["merged.largest", found.largest_mm]]);
    const told = view.against === "mesh" ? this.#merge?.deviation : null;
    const tolerance = told?.tolerance_mm;
    return [
      h("p", {}, t("merged.off", { reference: said(found.reference), points: integer(found.counted) })),
      histogramPlot(found.histogram, found.limit_mm, tolerance),
      h("dl", { class: "pairs number" }, ...pairs.map(([name, value]) => h("div", {}, h("dt", {}, t(name)), h("dd", {}, small(value)))),
        told?.uncertainty_mm && this.#merge?.verdict !== "fail" ? h("div", {}, h("dt", {}, t("merged.uncertainty")), h("dd", {}, small(told.uncertainty_mm))) : null,
        ...(tolerance ? BANDS.map((band) => h("div", {}, h("dt", {}, t(`merged.${band}`, { tolerance: fixed(tolerance, 3) })), h("dd", {}, percent(told?.[`${band}_tolerance`])))) : []),
        found.diameter_mm ? h("div", {}, h("dt", {}, t("merged.found_diameter")), h("dd", {}, `${fixed(found.diameter_mm, 3)} mm`)) : null),
      h("p", { class: "soft small" }, t("merged.signs")),
    ];
  }

  #tellScene() {
    void api.showCloud(this.state.id, this.#view, this.#picks[this.#click]).catch(() => undefined);
  }

  /** @param {CloudView} view @returns {Promise<Node[]>} */
  async #slice(view) {
    this.#drawSlab = null;
    if (!view.axis) return [];
    const found = await api.cloudSection(this.state.id, view).catch(refused);
    // Without the sphere that is compared with, the section is still worth its points.
    const section = found instanceof Problem ? await api.cloudSection(this.state.id, { ...view, colors: "height" }).catch(refused) : found;
    if (section instanceof Problem) return [mark("warn", section.message)];
    const plot = h("div", {});
    this.#drawSlab = () => putChildren(plot, () => [sectionPlot(section, this.#picks[this.#click], (point) => this.#pick(point), this.#aim, view.against === "mesh" ? this.#merge?.deviation?.tolerance_mm : null)]);
    this.#drawSlab();
    return [plot, h("p", { class: "soft small" }, t("merged.slice", { width: fixed(section.width_mm, 1), points: integer(section.count) }))];
  }

  /** The merge's result, with the nominal beside it where one is told. */
  get #merge() {
    return /** @type {MergeResult | undefined} */ (this.state.results[this.stage]);
  }

  /** A click measures from the place before, adds a datum point, or a point of the plane to cut by. @param {Point} point */
  #pick(point) {
    const click = this.#click;
    const now = this.#picks[click];
    if (now.length < CLICKS[click]) this.#picks[click] = [...now, point];
    else if (click === "measure") this.#picks[click] = [point];
    if (click === "plane") this.#cutBy(this.#picks.plane);
    this.#mark();
  }

  /** Cut the cloud by the plane through three points. @param {readonly Point[]} points */
  #cutBy([first, second, third]) {
    if (!first || !second || !third) return;
    const normal = across(minus(second, first), minus(third, first));
    this.#picks.plane = [];
    if (!normal) return void say(t("merged.in_a_line"));
    this.#normal = normal;
    this.#axis.value = "plane";
    const { low, high } = this.#ends();
    Object.assign(this.#at, { min: String(low), max: String(high), step: "any" });
    views.set(this.state.id, { ...this.#view, axis: "plane", normal });
    this.#at.value = String(dot(normal, first));
    this.#changed();
  }

  /** Show what was picked, here and in the scene. */
  #mark() {
    this.#drawPicked();
    this.#drawSlab?.();
    this.#tellScene();
  }

  /** What was picked: a distance with its parts, datum points until there are six, or points of a plane. */
  #drawPicked() {
    const points = this.#picks[this.#click];
    const clear = h("button", { type: "button", class: "plain", hidden: !points.length, onclick: () => this.#clear() }, t("merged.clear"));
    if (this.#click === "plane") return void this.#picked.replaceChildren(h("p", {}, t("merged.plane", { count: points.length })), clear);
    if (this.#click === "measure") {
      const [one, other] = points;
      const apart = one && other ? minus(other, one) : null;
      const [x = "", y = "", z = ""] = (apart ?? []).map((value) => fixed(value, 3));
      this.#picked.replaceChildren(
        h("p", { class: "number" }, apart ? t("merged.distance", { distance: fixed(Math.hypot(...apart), 3), x, y, z }) : t("merged.click_two")), clear);
      return;
    }
    const aligned = this.#merge?.alignment;
    const touches = this.#click === "datum";
    this.#picked.replaceChildren(
      h("p", {}, aligned ? t(touches ? "merged.datum" : "merged.features", { count: points.length }) : t("merged.no_alignment")),
      h("ol", { class: "number" }, ...points.map((point) => h("li", {}, `${point.map((value) => fixed(value, 2)).join(" · ")} mm`, ...(touches ? [] : featureFields(point))))),
      h("div", { class: "row" },
        h("button", { type: "button", needs: "capture", disabled: points.length < (touches ? CLICKS.datum : 1) || !aligned, onclick: () => void this.#align(points) }, t("merged.align")),
        clear,
        h("button", { type: "button", class: "plain", needs: "capture", hidden: !aligned || !["3-2-1", "datums"].includes(aligned.method), onclick: () => void this.#align(null) }, t("merged.best_fit"))),
    );
  }

  #clear() {
    this.#picks[this.#click] = [];
    this.#mark();
  }

  /** Merge again, the nominal laid by six points or by features of the cloud, or by a best fit. @param {readonly Point[] | null} points */
  async #align(points) {
    await attempt(async () => {
      const found = this.#merge?.alignment;
      if (this.state.working || !found) return;
      const places = points?.map((point) => inReference(found.cloud_from_reference, point));
      const datums = points?.map((point, index) => ({ point_mm: places?.[index], ...featureOf(point) }));
      const laid = this.#click === "datum" ? { method: "3-2-1", datum_points_mm: places } : { method: "datums", datums };
      await api.changeSession(this.state.id, { cell: { merge: { alignment: places ? laid : null } } });
      this.#picks[this.#click] = [];
      this.state.follows(await api.solve(this.state.id, this.stage));
    });
  }

  async #upload() {
    const file = this.#file.files?.[0];
    if (!file) return;
    await attempt(async () => {
      const { triangles } = await api.putReference(this.state.id, file);
      say(t("merged.added", { triangles: integer(triangles) }));
    });
    this.#file.value = "";
    this.#changed();
  }

  async #remove() {
    await attempt(() => api.removeReference(this.state.id));
    this.#changed();
  }
}

/** @param {Point} point */
const featureOf = (point) => features.get(point) ?? { kind: /** @type {"plane" | "sphere"} */ ("plane"), radius_mm: 5 };

/** What a datum feature is, and its radius. @param {Point} point */
function featureFields(point) {
  const { kind, radius_mm } = featureOf(point);
  const change = () => void features.set(point, { kind: FEATURES[which.selectedIndex] ?? "plane", radius_mm: typedNumber(radius.value) > 0 ? typedNumber(radius.value) : radius_mm });
  const which = h("select", { "aria-label": t("merged.feature"), onchange: change }, ...FEATURES.map((one) => h("option", { value: one, selected: one === kind }, t(`merged.feature_${one}`))));
  const radius = h("input", { inputmode: "decimal", autocomplete: "off", size: 5, "aria-label": t("merged.feature_radius"), value: String(inField(radius_mm)), oninput: change });
  return [" ", which, " ", radius];
}

/** @param {number | null | undefined} share */
const percent = (share) => (typeof share === "number" ? `${fixed(100 * share, 2)} %` : "–");

/** @param {Point} a @param {Point} b */
const minus = (a, b) => a.map((value, axis) => value - (b[axis] ?? 0));

/** @param {Point} a @param {Point} b */
const dot = (a, b) => a.reduce((sum, value, axis) => sum + value * (b[axis] ?? 0), 0);

/** The unit vector across two others; null where they lie in a line. @param {Point} a @param {Point} b */
function across([x = 0, y = 0, z = 0], [u = 0, v = 0, w = 0]) {
  const normal = [y * w - z * v, z * u - x * w, x * v - y * u];
  const length = Math.hypot(...normal);
  return length > 1e-3 * Math.hypot(x, y, z) * Math.hypot(u, v, w) && length > 0 ? normal.map((value) => value / length) : null;
}

/** A point of the cloud in the nominal's own frame. @param {number[][]} cloudFromReference @param {Point} point */
function inReference(cloudFromReference, point) {
  const off = point.map((value, row) => value - (cloudFromReference[row]?.[3] ?? 0));
  return [0, 1, 2].map((column) => off.reduce((sum, value, row) => sum + value * (cloudFromReference[row]?.[column] ?? 0), 0));
}

/** @param {unknown} error */
function refused(error) {
  if (error instanceof Problem) return error;
  throw error;
}

customElements.define("sc-merged", MergedElement);
