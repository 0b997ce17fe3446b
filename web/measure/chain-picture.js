// The cell as a small picture of its chain: what carries what. Parts are moved by dragging one onto another, or by keyboard.

import { field, h, s, style } from "../dom.js";
import { inField, typedNumber } from "../format.js";
import { t } from "../texts.js";
import { carriersOf, cellOf, isAxis, partsOf, withChange, withNew, without } from "./chain.js";

await style("chain");

/** @import {Cell} from "../api-types.js" */
/** @import {Kind, Part} from "./chain.js" */

const COLUMN = 132, ROW = 44, WIDTH = 116, HEIGHT = 32, INDENT = 24;
/** @type {readonly (readonly [Kind, string])[]} */
const NEW = [["scanner", "scanner"], ["ball", "ball"], ["rotary", "axis"], ["linear", "rail"]];

export class ChainPictureElement extends HTMLElement {
  /** @type {Part[]} */
  #parts = [];
  #selected = "";
  #turntable = false;
  #cell = /** @type {Partial<Cell>} */ ({});
  /** @type {NonNullable<Cell["sphere_distances"]>} */
  #distances = [];
  #isNarrow = false;
  #picture = s("svg", { role: "group", "aria-label": t("chain.label"), "aria-describedby": "chain-hint", onkeydown: (/** @type {KeyboardEvent} */ event) => this.#key(event) });
  #fields = h("div", { class: "chain-part", "aria-live": "polite" });

  connectedCallback() {
    if (this.firstChild) return;
    const add = NEW.map(([kind, stem]) => h("button", { type: "button", onclick: () => this.#add(kind, stem) }, t(/** @type {"chain.add_ball"} */ (`chain.add_${kind}`))));
    this.append(h("p", { id: "chain-hint", class: "hint soft small" }, t("chain.hint")), this.#picture, h("div", { class: "row" }, ...add), this.#fields);
    this.#draw();
    new ResizeObserver(() => { if (this.#isNarrow !== this.#needsRows()) this.#draw(); }).observe(this);
  }

  /** Whether parts side by side would be too small to read. */
  #needsRows() {
    const widest = Math.max(...[...this.#places(false).places.values()].map(({ x }) => x)) + WIDTH;
    return this.clientWidth > 0 && this.clientWidth < 0.8 * widest;
  }

  /** @param {Partial<Cell>} cell */
  set cell(cell) {
    this.#cell = cell;
    this.#distances = cell.sphere_distances ?? [];
    this.#parts = partsOf(cell, this.#turntable);
    this.#draw();
  }

  /** @param {boolean} there */
  set turntable(there) {
    if (there === this.#turntable) return;
    this.#turntable = there;
    this.#parts = partsOf({ ...this.#cell, ...cellOf(this.#parts) }, there);
    this.#draw();
  }

  get hasTable() { return this.#turntable; }

  /** Whether an axis of a name of its own carries the object: the plain turntable is another one then. */
  get isAxisTold() {
    return this.#parts.some(({ carries, implied }) => carries === "object" && !implied);
  }

  /** What the record says; names that are gone are told as such, for a change of what is stored. */
  get value() {
    const value = cellOf(this.#parts);
    const gone = Object.keys(this.#cell.scanners ?? {}).map((name) => [name, undefined]);
    const balls = value.spheres?.map(({ name }) => name) ?? [], between = this.#distances.filter(({ between: ends, mm }) => mm > 0 && ends.every((end) => balls.includes(end)));
    return { ...value, sphere_distances: between.length ? between : undefined, scanners: value.scanners && { ...Object.fromEntries(gone), ...value.scanners } };
  }

  #add(/** @type {Kind} */ kind, /** @type {string} */ stem) {
    const before = new Set(this.#parts.map(({ id }) => id));
    this.#take(withNew(this.#parts, kind, stem));
    this.#select(this.#parts.filter(({ id }) => !before.has(id)).at(-1)?.id ?? "");
  }

  /** @param {Part[]} parts */
  #take(parts) {
    this.#parts = parts;
    this.#draw();
    this.dispatchEvent(new Event("change", { bubbles: true }));
  }

  /** @param {string} id */
  #select(id) {
    this.#selected = id;
    this.#draw();
    for (const one of this.#picture.querySelectorAll("[tabindex='0']")) /** @type {SVGElement} */ (one).focus();
  }

  /** Each part beside what carries it: its column is how far it is from base, its row the place among the leaves; where that is too wide, a row each. @param {boolean} narrow */
  #places(narrow) {
    /** @type {Map<string, { x: number, y: number }>} */
    const places = new Map();
    let row = 0;
    const put = (/** @type {Part} */ part, /** @type {number} */ column) => {
      const carried = this.#parts.filter(({ on }) => on === part.id);
      const first = row;
      if (narrow) places.set(part.id, { x: 4 + column * INDENT, y: 4 + row++ * ROW });
      for (const one of carried) put(one, column + 1);
      if (narrow) return;
      if (!carried.length) row++;
      places.set(part.id, { x: 4 + column * COLUMN, y: 4 + ((first + Math.max(row - 1, first)) / 2) * ROW });
    };
    for (const part of this.#parts) if (part.kind === "base") put(part, 0);
    return { places, rows: row };
  }

  #draw() {
    this.#isNarrow = this.#needsRows();
    const { places, rows } = this.#places(this.#isNarrow);
    const width = Math.max(...[...places.values()].map(({ x }) => x), 0) + WIDTH + 4, height = rows * ROW;
    this.#picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.#picture.style.maxWidth = `${width}px`;
    const chosen = this.#parts.find(({ id }) => id === this.#selected) ?? this.#parts[0];
    this.#picture.replaceChildren(...this.#parts.flatMap((part) => this.#link(part, places)), ...this.#parts.map((part) => this.#node(part, places, part === chosen)));
    const held = document.activeElement instanceof HTMLSelectElement && this.#fields.contains(document.activeElement) ? document.activeElement.id : "";
    const editable = chosen && (!chosen.implied || chosen.kind === "scanner");
    this.#fields.replaceChildren(...(editable ? this.#editor(chosen) : []).filter((one) => one !== false));
    if (held) /** @type {HTMLElement | null} */ (this.#fields.querySelector(`[id="${held}"]`))?.focus();
  }

  /** @param {Part} part @param {Map<string, { x: number, y: number }>} places */
  #link(part, places) {
    const from = places.get(part.on), to = places.get(part.id);
    if (!from || !to) return [];
    if (this.#isNarrow) return [s("path", { class: "link", d: `M${from.x + INDENT / 2} ${from.y + HEIGHT}V${to.y + HEIGHT / 2}H${to.x}`, "aria-hidden": "true" })];
    const x = from.x + WIDTH, middle = (x + to.x) / 2, y = from.y + HEIGHT / 2, end = to.y + HEIGHT / 2;
    return [s("path", { class: "link", d: `M${x} ${y} C${middle} ${y} ${middle} ${end} ${to.x} ${end}`, "aria-hidden": "true" })];
  }

  /** @param {Part} part @param {Map<string, { x: number, y: number }>} places @param {boolean} chosen */
  #node(part, places, chosen) {
    const { x, y } = places.get(part.id) ?? { x: 0, y: 0 };
    const carrier = this.#parts.find(({ id }) => id === part.on);
    const label = carrier ? t("chain.on", { part: words(part), carrier: words(carrier) }) : words(part);
    return s(
      "g", {
        class: `node ${part.kind}${part.implied ? " implied" : ""}`, transform: `translate(${x} ${y})`, role: "button", tabindex: chosen ? 0 : -1,
        "aria-label": label, "aria-pressed": String(part.id === this.#selected), "data-part": part.id,
        onclick: () => this.#select(part.id), onpointerdown: (/** @type {PointerEvent} */ event) => this.#drag(event, part),
      },
      s("rect", { class: "box", width: WIDTH, height: HEIGHT, rx: 6 }),
      s("path", { class: "sign", d: SIGNS[part.kind], transform: "translate(8 7)" }),
      s("text", { x: 32, y: 21 }, words(part, true)),
    );
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const id = event.target instanceof Element && event.target.closest("[data-part]")?.getAttribute("data-part");
    const here = this.#parts.find((part) => part.id === id);
    if (!here) return;
    const same = this.#parts.filter(({ on }) => on === here.on), place = same.indexOf(here);
    const next = {
      ArrowLeft: here.on, ArrowRight: this.#parts.find(({ on }) => on === here.id)?.id,
      ArrowUp: same[place - 1]?.id, ArrowDown: same[place + 1]?.id,
    }[event.key];
    if (event.key === "Delete" && !here.implied) this.#remove(here);
    else if (event.key === "Enter" || event.key === " ") {
      this.#select(here.id);
      /** @type {HTMLElement | null} */ (this.#fields.querySelector("input, select"))?.focus();
    }
    else if (next) this.#select(next);
    else return;
    event.preventDefault();
  }

  /** @param {Part} part */
  #remove(part) {
    this.#selected = part.on;
    this.#take(without(this.#parts, part));
  }

  /** @param {PointerEvent} event @param {Part} part */
  #drag(event, part) {
    const able = new Set(carriersOf(this.#parts, part).map(({ id }) => id));
    const node = /** @type {SVGGElement} */ (event.currentTarget);
    if (event.button || !able.size || (part.implied && part.kind !== "scanner")) return;
    const scale = this.#picture.viewBox.baseVal.width / this.#picture.getBoundingClientRect().width;
    const start = node.getAttribute("transform") ?? "";
    const target = (/** @type {PointerEvent} */ { clientX, clientY }) => document.elementsFromPoint(clientX, clientY).map((one) => one.closest("[data-part]")?.getAttribute("data-part")).find((id) => id && able.has(id));
    const move = (/** @type {PointerEvent} */ now) => {
      node.setAttribute("transform", `${start} translate(${(now.clientX - event.clientX) * scale} ${(now.clientY - event.clientY) * scale})`);
      for (const one of this.#picture.querySelectorAll("[data-part]")) one.classList.toggle("target", one.getAttribute("data-part") === target(now));
    };
    const end = (/** @type {PointerEvent} */ now) => {
      for (const [name, listener] of /** @type {const} */ ([["pointermove", move], ["pointerup", end], ["pointercancel", end]])) window.removeEventListener(name, listener);
      const onto = now.type === "pointerup" ? target(now) : undefined;
      if (onto && onto !== part.on) this.#take(withChange(this.#parts, part, { on: onto }));
      else node.setAttribute("transform", start);
    };
    window.addEventListener("pointermove", move);
    window.addEventListener("pointerup", end);
    window.addEventListener("pointercancel", end);
  }

  /** @param {Part} part @returns {(HTMLElement | false)[]} */
  #editor(part) {
    const change = (/** @type {Partial<Part>} */ what) => {
      const after = withChange(this.#parts, part, what), { name: now } = what;
      if (now && part.kind === "ball") this.#distances = this.#distances.map((one) => ({ ...one, between: one.between.map((end) => (end === part.name ? now : end)) }));
      this.#selected = after[after.length && this.#parts.length === after.length ? after.findIndex(({ id }) => !this.#parts.some((one) => one.id === id)) : -1]?.id ?? part.id;
      this.#take(after);
    };
    const on = choice(part.on, carriersOf(this.#parts, part).map((other) => [other.id, words(other)]), (id) => change({ on: id }));
    const name = h("input", { type: "text", autocomplete: "off", maxlength: 64, pattern: "[A-Za-z0-9][A-Za-z0-9._\\-]*", value: part.name, onchange: () => this.#rename(part, name, change) });
    /** @type {(HTMLElement | false)[]} */
    const fields = [field("chain-on", t("chain.carrier"), on)];
    if (part.name) fields.unshift(field("chain-name", t("name"), name));
    if (part.kind === "ball") {
      fields.push(field("chain-diameter", t("new.diameter"), number(part.diameter_mm, (diameter_mm) => this.#tell(() => { part.diameter_mm = diameter_mm; })), t("chain.diameter_hint")));
      for (const other of this.#parts) if (part.name && other.kind === "ball" && other !== part) fields.push(...this.#distanceFields(part.name, other.name));
    }
    if (isAxis(part.kind)) {
      const told = part.told ?? {}, sigma = part.kind === "rotary" ? "sigma_deg" : "sigma_mm";
      const tell = (/** @type {Record<string, unknown>} */ what) => this.#tell(() => { part.told = { ...part.told, ...what }; });
      fields.push(
        field("chain-carries", t("chain.carries"), choice(part.carries ?? "object", [["object", t("chain.object")], ["robot", t("chain.robot")]], (carries) => change({ carries: carries === "robot" ? "robot" : "object" }))),
        part.kind === "rotary" && field("chain-direction", t("chain.direction"), choice(String(told["direction"] ?? ""), [["", t("chain.data")], ["1", t("chain.right")], ["-1", t("chain.left")]], (way) => tell({ direction: way ? Number(way) : undefined })), t("chain.direction_hint")),
        field("chain-encoder", t("chain.encoder"), choice(String(told["encoder"] ?? ""), [["", t("chain.data")], ["exact", t("chain.exact")], ["scale", t("chain.scale")]], (encoder) => tell({ encoder: encoder || undefined }))),
        field("chain-sigma", t(`chain.${sigma}`), number(told[sigma], (value) => tell({ [sigma]: value ?? undefined }), true)),
      );
    }
    if (part.implied) return fields;
    return [...fields, h("button", { type: "button", class: "plain wide", onclick: () => this.#remove(part) }, t("chain.remove", { name: words(part) }))];
  }

  /** How far two balls are apart, where it is known. @param {string} name @param {string} other */
  #distanceFields(name, other) {
    let known = this.#distances.find(({ between }) => between.includes(name) && between.includes(other));
    const tell = (/** @type {{ mm?: number, sigma_mm?: number | undefined }} */ what) => this.#tell(() => {
      const told = { between: [name, other], mm: 0, ...known, ...what };
      this.#distances = [...this.#distances.filter((one) => one !== known), told];
      known = told;
    });
    return [
      field(`chain-distance-${other}`, t("chain.distance", { name: other }), number(known?.mm || null, (mm) => tell({ mm: mm ?? 0 }))),
      field(`chain-distance-sigma-${other}`, t("chain.distance_sigma", { name: other }), number(known?.sigma_mm, (mm) => tell({ sigma_mm: mm ?? undefined }), true)),
    ];
  }

  /** A change that moves nothing: the fields stay, and the focus in them. @param {() => void} change */
  #tell(change) {
    change();
    this.dispatchEvent(new Event("change", { bubbles: true }));
  }

  /** @param {Part} part @param {HTMLInputElement} input @param {(what: Partial<Part>) => void} change */
  #rename(part, input, change) {
    const name = input.value.trim(), taken = this.#parts.some((other) => other.id !== part.id && other.name === name);
    input.setCustomValidity(taken || !name ? t("chain.name_taken") : "");
    if (input.reportValidity()) change({ name });
  }
}

/** Whether there is a turntable: asked where no axis of another name tells it. @param {ChainPictureElement} chain @param {string} id @param {string} label @param {(there: boolean) => void} [told] */
export function turntableBox(chain, id, label, told) {
  const input = h("input", { type: "checkbox", name: "turntable", id, value: "yes", onchange: () => { chain.turntable = input.checked; told?.(input.checked); } });
  const element = h("div", { class: "row whole" }, input, h("label", { for: id }, label));
  const look = () => { element.hidden = chain.isAxisTold && !input.checked; };
  chain.addEventListener("change", look);
  input.checked = chain.hasTable;
  look();
  return { element, input };
}

/** A field of a length or an angle that may be left out. @param {unknown} value @param {(value: number | null) => void} take @param {boolean} [mayBeZero] */
function number(value, take, mayBeZero = false) {
  const input = h("input", { type: "text", inputmode: "decimal", autocomplete: "off", value: inField(value ?? ""), onchange: () => {
    const typed = input.value.trim() ? typedNumber(input.value) : null;
    input.setCustomValidity(typed === null || typed > 0 || (mayBeZero && typed === 0) ? "" : t("new.need_number"));
    if (input.reportValidity()) take(typed);
  } });
  return input;
}

/** @param {string} value @param {[string, string][]} options @param {(value: string) => void} take */
function choice(value, options, take) {
  const select = h("select", { onchange: () => take(select.value) }, ...options.map(([one, label]) => h("option", { value: one }, label)));
  select.value = value;
  return select;
}

/** A part as people call it. @param {Part} part @param {boolean} [short] without its kind where it has a name */
function words(part, short = false) {
  const kind = t(/** @type {"chain.base"} */ (`chain.${part.kind === "robot" ? "arm" : part.kind}`));
  if (!part.name) return kind;
  if (part.id === "table") return t("chain.table");
  return short ? part.name : `${kind} ${part.name}`;
}

/** @type {Record<Kind, string>} signs of 18 by 18 */
const SIGNS = {
  base: "M1 16h16M4 16l2-6h6l2 6",
  robot: "M4 17V9l6-5 5 4v4M2 17h5M13 12h4",
  flange: "M3 9h6M9 3v12M13 5v8",
  scanner: "M4 2h10v6H4zM9 8l-5 9M9 8l5 9",
  ball: "M9 2a7 7 0 1 0 .01 0z",
  rotary: "M15 5a7 7 0 1 0 1 6M16 1v5h-5",
  linear: "M1 9h16M4 6 1 9l3 3M14 6l3 3-3 3",
};

customElements.define("sc-chain-picture", ChainPictureElement);
