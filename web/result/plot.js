// Every plot of the page: dots, lines, bars or cells with their axes. A dot that stands for a capture can be hovered, picked
// and left out, by mouse, touch and keys; what is picked lights up in table and scene.

import { h, make, s } from "../dom.js";
import { fixed, significant } from "../format.js";
import { said, t } from "../texts.js";
import { excludeCapture } from "../measure/exclude.js";
import { piece, viewsOf, widened } from "./plot-view.js";
import { thumbnail } from "../measure/thumbnail.js";
import { withoutWords } from "./exclusion-effect.js";

/** @import {Range} from "./plot-view.js" */
/** @import {AxisOf, PlotBlock, Residual, SeriesOf} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */
/** @typedef {{ low: number, high: number, place: (value: number) => number }} Scale */
/** @typedef {{ series: number, x: number, xValue: number, y: number, value: number, at: string, capture: string | undefined, reason: string | null | undefined, beyond: boolean }} Dot */

const WIDTH = 560;
const HEIGHT = 190;
const EDGE = { left: 58, right: 12, top: 12, bottom: 40 };
const DOTS_AT_ONCE = 150;
/** The smallest piece that is shown, of the whole. */
const LEAST = 0.002;
/** @type {Record<string, number>} */
const ZOOM_KEYS = { "+": 0.5, "=": 0.5, "-": 2, "0": Infinity };
/** Beyond it a plot over captures is no wider: dots stand closer. */
const WIDEST = 6000;
const FULL = 1040;  // at the size of the window: letters stay as they are
const ZOOMED = ["captures", "xy"];
const MARKS = ["circle", "square", "diamond", "triangle"];

/** Which figures and which piece were chosen of a session's plots: they may be drawn anew while one looks. @type {WeakMap<SessionState, Map<string, { index: number, range: Range | null }>>} */
const chosen = new WeakMap();

export class PlotElement extends HTMLElement {
  /** @type {PlotBlock | null} */ block = null;
  /** @type {SessionState | null} */ state = null;
  /** Where the words below it stand: they go along with the figures shown. @type {HTMLElement | null} */ caption = null;
  #tip = h("div", { class: "tip", role: "status", hidden: true });
  /** @type {(() => void) | null} */ #stop = null;
  /** The figures that are shown of the dots. @type {PlotBlock | null} */ #view = null;
  /** The piece that is shown; null is the whole. @type {Range | null} */ #range = null;
  /** How far the whole reaches. @type {Range | null} */ #whole = null;
  #drawing = h("div");
  #legend = h("div");

  connectedCallback() {
    if (!this.block) return;
    if (!this.firstChild) {
      const rows = /** @type {Residual[]} */ (this.state?.resultOf(this.state.step)?.residuals ?? []);
      const views = viewsOf(this.block, rows);
      this.#view = views[this.#index]?.block ?? this.block;
      this.append(this.#drawing, h("div", { class: "row spread" }, this.#legend, this.#tools(views)), this.#tip);
      const range = this.#chosen.get(this.#id)?.range ?? null;
      if (range) this.#draw(); // how far the whole reaches
      this.#range = range;
      this.#draw();
    }
    this.#stop = this.state?.watch(["selection"], () => this.#light()) ?? null;
  }

  get #id() {
    return `${this.state?.step} ${this.block?.id ?? this.block?.title ?? ""}`;
  }

  get #index() {
    return this.#chosen.get(this.#id)?.index ?? 0;
  }

  get #chosen() {
    const known = (this.state && chosen.get(this.state)) ?? new Map();
    if (this.state) chosen.set(this.state, known);
    return known;
  }

  /** What is shown, and zooming. @param {{ label: string, block: PlotBlock }[]} views */
  #tools(views) {
    if (!ZOOMED.includes(this.block?.shape ?? "")) return "";
    const select = h("select", { "aria-label": t("plot.shown"), onchange: () => {
      this.#view = views[select.selectedIndex]?.block ?? this.block;
      this.#chosen.set(this.#id, { index: select.selectedIndex, range: null });
      this.#range = null;
      this.#draw();
    } }, ...views.map(({ label }) => h("option", {}, label)));
    select.selectedIndex = Math.min(this.#index, views.length - 1);
    const button = (/** @type {string} */ sign, /** @type {"plot.zoom_in" | "plot.zoom_out" | "plot.zoom_all"} */ key, /** @type {() => void} */ act) =>
      h("button", { type: "button", class: "plain icon", "aria-label": t(key), title: t(key), onclick: act }, sign);
    return h("div", { class: "row plot-tools" }, views.length > 1 && select,
      button("+", "plot.zoom_in", () => this.zoom(0.5)), button("−", "plot.zoom_out", () => this.zoom(2)), button("⤢", "plot.zoom_all", () => this.zoom(Infinity)));
  }

  #draw() {
    if (!this.#view) return;
    this.hide();
    const shown = piece(this.#view, this.#range);
    const drawn = draw(shown, this);
    if (!this.#range) this.#whole = { x: [drawn.x.low, drawn.x.high], y: [drawn.y.low, drawn.y.high] };
    this.#drawing.replaceChildren(drawn.root);
    this.#legend.replaceChildren(legend(shown));
    if (this.caption) this.caption.textContent = said(shown.caption ?? "");
    if (this.isConnected) this.#light();
  }

  /** So many times as much is shown, about the dot that has the focus, the picked one, or the middle. @param {number} times */
  zoom(times) {
    if (!this.#whole) return;
    const now = this.#range ?? this.#whole;
    const dot = this.querySelector(".dot:focus") ?? this.querySelector(".dot.picked");
    const name = dot?.getAttribute("data-capture"), focused = dot?.matches(":focus");
    const place = this.#placeOf(dot);
    const middle = { x: (now.x[0] + now.x[1]) / 2, y: (now.y[0] + now.y[1]) / 2 };
    const range = times === Infinity ? null : widened(now, this.#whole, place ?? middle, times);
    if (range && range.x[1] - range.x[0] < LEAST * (this.#whole.x[1] - this.#whole.x[0])) return;
    this.#range = range;
    this.#chosen.set(this.#id, { index: this.#index, range });
    this.#draw();
    if (focused && name) /** @type {SVGElement | null} */ (this.querySelector(`.dot[data-capture="${CSS.escape(name)}"]`))?.focus();
  }

  /** Where a dot stands, in the plot's units. @param {Element | null} dot */
  #placeOf(dot) {
    const [x, y] = (dot?.getAttribute("data-at") ?? "").split(" ").map(Number);
    return dot && x !== undefined && y !== undefined ? { x, y } : null;
  }

  disconnectedCallback() {
    this.#stop?.();
  }

  /** All dots are there: the picked one among them lights up. */
  lit() {
    if (this.isConnected && this.state?.selected) this.#light();
  }

  #light() {
    for (const dot of this.querySelectorAll("[data-capture]")) {
      const picked = dot.getAttribute("data-capture") === this.state?.selected;
      dot.classList.toggle("picked", picked);
      dot.setAttribute("aria-pressed", String(picked));
    }
  }

  /** @param {SVGElement} mark @param {Dot} dot */
  show(mark, dot) {
    const capture = this.state?.captures.find((one) => one.id === dot.capture);
    this.#tip.replaceChildren(
      ...(capture && (capture.measured.preview ?? []).length ? [thumbnail(capture)] : []),
      h("p", {}, h("strong", {}, dot.at), h("br"), wordsOf(dot, this.#view), dot.reason && h("span", { class: "why" }, said(dot.reason)), this.#without(dot)));
    this.#tip.hidden = false;
    const box = this.getBoundingClientRect();
    const at = mark.getBoundingClientRect();
    const left = Math.min(Math.max(at.left - box.left - 80, 0), Math.max(0, box.width - this.#tip.offsetWidth));
    this.#tip.style.left = `${left}px`;
    this.#tip.style.top = `${at.top - box.top - this.#tip.offsetHeight - 6}px`;
  }

  /** What excluding its capture would do. @param {Dot} dot */
  #without({ capture }) {
    const words = withoutWords(this.state, capture);
    return words && h("span", { class: "without" }, `${words} ${t("without.key")}`);
  }

  hide() {
    this.#tip.hidden = true;
  }

  /** @param {KeyboardEvent} event @param {Dot} dot */
  key(event, dot) {
    const dots = /** @type {SVGElement[]} */ ([...this.querySelectorAll(".dot")]);
    const place = dots.findIndex((one) => one === event.currentTarget);
    const next = { ArrowRight: place + 1, ArrowLeft: place - 1, Home: 0, End: dots.length - 1 }[event.key];
    if (next !== undefined) dots[next]?.focus();
    else if (event.key === "Enter" || event.key === " ") this.pick(dot);
    else if (event.key in ZOOM_KEYS) this.zoom(ZOOM_KEYS[event.key] ?? 1);
    else if (event.key === "Delete" || event.key.toLowerCase() === "x") this.exclude(dot);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** @param {Dot} dot */
  pick({ capture }) {
    if (capture) this.state?.select(capture);
  }

  /** @param {Dot} dot */
  exclude({ capture }) {
    const found = this.state?.captures.find((one) => one.id === capture);
    if (found && this.state && !("timeline" in this.state)) void excludeCapture(this.state, found);
  }
}

customElements.define("sc-plot", PlotElement);

/** @param {PlotBlock} block @param {SessionState | null} [state] @param {HTMLElement | null} [caption] */
export const plot = (block, state = null, caption = null) => make(PlotElement, { block, state, caption });

/** @param {Dot} dot @param {PlotBlock | null} block */
function wordsOf(dot, block) {
  const label = block && block.series.length > 1 ? `${block.series[dot.series]?.label}: ` : "";
  return `${label}${withUnit(dot.value, block?.y.unit ?? "")}`;
}

/** @param {number} value @param {string} unit */
const withUnit = (value, unit) => `${significant(value, 3)}${unit ? `\u202f${unit}` : ""}`;

/** The drawing and its scales. @param {PlotBlock} block @param {PlotElement} element @returns {{ root: Element, x: Scale, y: Scale }} */
function draw(block, element) {
  const label = `${said(block.caption)} ${t("plot.keys")}`;
  const none = { low: 0, high: 0, place: Number };
  if (block.shape === "grid") return { root: grid(block), x: none, y: none };
  if (block.shape === "section") return { root: h("div", { class: "plot-holder" }, section(block)), x: none, y: none };
  const width = block.shape === "captures" ? Math.min(WIDEST, Math.max(WIDTH, EDGE.left + longest(block) * 14)) : element.closest("dialog.full-size") ? FULL : WIDTH;
  const x = scaleX(block, width);
  const y = scaleY(block);
  const root = s("svg", { class: `plot plot-${block.shape}`, viewBox: `0 0 ${width} ${HEIGHT}`, style: `max-width: ${width}px`, role: "group", "aria-label": label });
  if (block.band) {
    const [top, bottom] = [y.place(Math.min(block.band.high, y.high)), y.place(Math.max(block.band.low, y.low))];
    root.append(s("rect", { class: "band", x: EDGE.left, y: top, width: width - EDGE.left - EDGE.right, height: bottom - top }));
  }
  root.append(...axes(block, x, y, width));
  if (block.shape === "histogram") root.append(...bars(block, x, y));
  else if (block.shape === "line") root.append(...block.series.map((one, index) => line(one, index, x, y)));
  else addLater(root, dotsOf(block, x, y), element, block);
  return { root: h("div", { class: "plot-holder" }, root), x, y };
}

/** An outline and dots about it, to one scale. @param {PlotBlock} block */
function section({ series, caption }) {
  const [outline, ...others] = series;
  const all = series.flatMap((one) => one.y.flatMap((value, index) => (value === null ? [] : [[xOf(one, index), value]])));
  const ends = [0, 1].map((axis) => {
    const places = all.map((place) => place[axis] ?? 0);
    return [places.reduce((one, other) => Math.min(one, other), Infinity), places.reduce((one, other) => Math.max(one, other), -Infinity)];
  });
  const [[left, right], [low, high]] = /** @type {[[number, number], [number, number]]} */ (ends);
  const per = Math.min((WIDTH - 20) / (right - left || 1), 360 / (high - low || 1));
  const place = (/** @type {SeriesOf} */ one, /** @type {number} */ index, /** @type {number} */ value) => `${((WIDTH - (right - left) * per) / 2 + (xOf(one, index) - left) * per).toFixed(1)} ${(10 + (high - value) * per).toFixed(1)}`;
  const path = (/** @type {SeriesOf | undefined} */ one, /** @type {string} */ then) => one?.y.map((value, index) => (value === null ? "" : `${then && one.y[index - 1] !== null && index ? then : "M"}${place(one, index, value)}${then ? "" : "h0"}`)).join("");
  return s("svg", { class: "section-plot", viewBox: `0 0 ${WIDTH} ${((high - low) * per + 20).toFixed(0)}`, role: "img", "aria-label": said(caption) },
    s("path", { class: "nominal", d: path(outline, "L") }), ...others.map((one) => s("path", { class: "dots", d: path(one, "") })));
}

/** Many dots are added a few at a time, so that the page stays fluid. @param {SVGElement} root @param {Dot[]} dots @param {PlotElement} element @param {PlotBlock} block */
function addLater(root, dots, element, block, from = 0) {
  root.append(...dots.slice(from, from + DOTS_AT_ONCE).map((dot, index) => mark(dot, from + index === 0, element, block)));
  if (from + DOTS_AT_ONCE < dots.length) setTimeout(() => addLater(root, dots, element, block, from + DOTS_AT_ONCE));
  else element.lit();
}

/** @param {PlotBlock} block */
const longest = ({ series }) => Math.max(0, ...series.map(({ y }) => y.length));

/** @param {SeriesOf} series @param {number} index */
const xOf = ({ x = [] }, index) => x[index] ?? index;

/** @param {PlotBlock} block @param {number} width @returns {Scale} */
function scaleX({ shape, x, series }, width) {
  const values = series.flatMap((one) => one.y.map((_, index) => xOf(one, index)));
  let [low, high] = [x.low ?? Math.min(...values), x.high ?? Math.max(...values)];
  if (shape === "captures") [low, high] = [low - 0.5, high + 0.5];
  else if (shape === "histogram") high += (series[0]?.x?.[1] ?? 1) - (series[0]?.x?.[0] ?? 0);
  const inner = shape === "xy" ? 10 : 0;
  return scale(low, high, EDGE.left + inner, width - EDGE.right - inner);
}

/** @param {PlotBlock} block @returns {Scale} */
function scaleY({ y, series, band }) {
  // What was rejected may lie far off: it is drawn at the edge.
  const used = series.flatMap((one) => one.y.filter((value, index) => value !== null && !one.reasons?.[index]));
  const values = [...used, band?.high, band?.low].filter((value) => typeof value === "number");
  const high = y.high ?? Math.max(...values);
  const low = y.low ?? Math.min(0, ...values);
  return scale(low, high + (y.high === null || y.high === undefined ? (high - low) * 0.08 : 0), HEIGHT - EDGE.bottom, EDGE.top);
}

/** @param {number} low @param {number} high @param {number} from @param {number} to @returns {Scale} */
function scale(low, high, from, to) {
  if (!(high > low)) [low, high] = [low - 0.5, low + 0.5];
  const place = (/** @type {number} */ value) => Math.round((from + ((Math.min(Math.max(value, low), high) - low) / (high - low)) * (to - from)) * 10) / 10;
  return { low, high, place };
}

/** Round numbers between two ends. @param {Scale} scale @param {number} most */
function ticks({ low, high }, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((one) => one * power >= rough) ?? 10);
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return { decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), values: Array.from({ length: count }, (_, index) => (first + index) * step) };
}

/** @param {PlotBlock} block @param {Scale} x @param {Scale} y @param {number} width */
function axes(block, x, y, width) {
  const rows = ticks(y, 4);
  const parts = rows.values.flatMap((value) => [
    s("path", { class: "grid", d: `M${EDGE.left} ${y.place(value)}H${width - EDGE.right}` }),
    s("text", { class: "tick", x: EDGE.left - 6, y: y.place(value) + 4, "text-anchor": "end" }, fixed(value, rows.decimals)),
  ]);
  for (const [value, text] of columns(block, x)) parts.push(s("text", { class: "tick", x: x.place(value), y: HEIGHT - 24, "text-anchor": "middle" }, text));
  parts.push(s("text", { class: "axis-title", x: (EDGE.left + width) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, titleOf(block.x)));
  parts.push(s("text", { class: "axis-title", transform: `translate(12 ${(HEIGHT - EDGE.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, titleOf(block.y)));
  return parts;
}

/** @param {AxisOf} axis */
const titleOf = ({ label, unit }) => (unit ? `${said(label)}, ${unit}` : said(label));

/** @param {PlotBlock} block @param {Scale} x @returns {[number, string][]} */
function columns({ shape, series }, x) {
  const names = series[0]?.captures ?? [];
  if (shape !== "captures" || !names.length) {
    const { values, decimals } = ticks(x, 7);
    const rounds = values.filter((value) => Number.isInteger(value)); // there is no half of a round
    const counts = rounds.length > 1 && series.every((one) => one.y.every((_, index) => Number.isInteger(xOf(one, index))));
    return (counts ? rounds : values).map((value) => [value, fixed(value, counts ? 0 : decimals)]);
  }
  const every = Math.ceil(names.length / 12);
  return names.flatMap((name, index) => (index % every ? [] : [/** @type {[number, string]} */ ([xOf(series[0] ?? { y: [] }, index), name])]));
}

/** @param {PlotBlock} block @param {Scale} x @param {Scale} y @returns {Dot[]} */
function dotsOf({ series }, x, y) {
  return series.flatMap((one, which) => one.y.flatMap((value, index) => value === null ? [] : [{
    series: which, x: x.place(xOf(one, index)), xValue: xOf(one, index), y: y.place(value), value, beyond: value > y.high,
    capture: one.captures?.[index], reason: one.reasons?.[index], at: one.captures?.[index] ?? fixed(xOf(one, index), 1),
  }]));
}

/** @param {Dot} dot @param {boolean} first @param {PlotElement} element @param {PlotBlock} block */
function mark(dot, first, element, block) {
  const words = [dot.at, wordsOf(dot, block), dot.reason && t("plot.rejected", { reason: said(dot.reason) })].filter(Boolean).join(", ");
  const shape = dot.reason ? "cross" : MARKS[dot.series % MARKS.length] ?? "circle";
  const group = s(
    "g", { class: `dot series-${dot.series % MARKS.length} ${dot.reason ? "out" : ""}`, role: "button", tabindex: first ? 0 : -1, "aria-label": words, "aria-pressed": "false", "data-capture": dot.capture, "data-at": `${dot.xValue} ${dot.value}`, transform: `translate(${dot.x} ${dot.y})` },
    s("circle", { class: "hit", r: 11 }), s("path", { d: SHAPES[shape] }), dot.beyond && s("path", { class: "beyond", d: "M-4 -8l4 -4l4 4" }));
  group.addEventListener("pointerenter", () => element.show(group, dot));
  group.addEventListener("focus", () => element.show(group, dot));
  group.addEventListener("pointerleave", () => element.hide());
  group.addEventListener("blur", () => element.hide());
  group.addEventListener("click", () => element.pick(dot));
  group.addEventListener("keydown", (event) => element.key(event, dot));
  return group;
}

/** @type {Record<string, string>} */
const SHAPES = {
  circle: "M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0 -9 0Z", square: "M-4 -4H4V4H-4Z", diamond: "M0 -5.5L5.5 0L0 5.5L-5.5 0Z", triangle: "M0 -5L5 4H-5Z", cross: "M-5 -5L5 5M5 -5L-5 5",
};

/** @param {SeriesOf} series @param {number} index @param {Scale} x @param {Scale} y */
function line(series, index, x, y) {
  let drawn = false;
  const d = series.y.map((value, at) => {
    const part = value === null ? "" : `${drawn ? "L" : "M"}${x.place(xOf(series, at))} ${y.place(value)}`;
    drawn = value !== null;
    return part;
  }).join("");
  return s("path", { class: `line series-${index % MARKS.length}`, d });
}

/** @param {PlotBlock} block @param {Scale} x @param {Scale} y */
function bars({ series, y: { unit } }, x, y) {
  const [first] = series;
  if (!first) return [];
  const width = first.x && first.x.length > 1 ? x.place(first.x[1] ?? 0) - x.place(first.x[0] ?? 0) : 20;
  return first.y.map((value, index) => s("rect", { class: "bar", x: x.place(xOf(first, index)) + 0.5, width: Math.max(1, width - 1), y: y.place(value ?? 0), height: y.place(0) - y.place(value ?? 0) }, s("title", {}, withUnit(value ?? 0, unit ?? ""))));
}

/** @param {PlotBlock} block */
function grid({ series, caption }) {
  const most = Math.max(1e-12, ...series.flatMap(({ y }) => y.map((value) => Math.abs(value ?? 0))));
  const columns = Math.max(1, ...series.map(({ y }) => y.length));
  const cells = series.flatMap(({ y }, row) => y.map((value, column) =>
    s("rect", { class: value ? "cell" : "cell empty", x: column, y: row, width: 1, height: 1, "fill-opacity": value ? (0.15 + 0.85 * Math.sqrt(Math.abs(value) / most)).toFixed(2) : 1 }, s("title", {}, value === null ? "–" : significant(value, 3)))));
  const rows = series.map(({ y }) => y.map((value) => (value === null ? "–" : significant(value, 2))).join(" ")).join("; ");
  return s("svg", { class: "plot plot-grid", viewBox: `0 0 ${columns} ${series.length}`, role: "img", "aria-label": `${said(caption)} ${rows}` }, ...cells);
}

/** @param {PlotBlock} block */
function legend({ shape, series, band }) {
  if (shape === "grid") return "";
  const rejected = series.some(({ reasons }) => reasons?.some(Boolean));
  const keys = series.length > 1 ? series.map(({ label }, index) => h("span", { class: `key ${shape} series-${index % MARKS.length}` }, said(label ?? ""))) : [];
  if (rejected) keys.push(h("span", { class: "key key-out" }, t("captures.rejected")));
  if (band) keys.push(h("span", { class: "key key-band" }, said(band.label)));
  return keys.length ? h("p", { class: "legend small" }, ...keys) : "";
}
