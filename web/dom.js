// Building elements without a template language: `h` makes one, `keyed` keeps a list of them in step with data.

import { only } from "./state/me.js";

/** @import {Role} from "./state/me.js" */
/** @typedef {Node | string | number | null | undefined | false} Child */
/** @typedef {Record<string, unknown>} Props */

const SVG = "http://www.w3.org/2000/svg";

/**
 * Set attributes, listeners (`onclick`) and properties (`.value`) of an element; `needs` names the role that it takes.
 * @param {Element} element
 * @param {Props} props
 */
function assign(element, props) {
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "needs") only(/** @type {Role} */ (value), element);
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
    else if (name.startsWith(".")) Reflect.set(element, name.slice(1), value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
}

/**
 * @param {Element} element
 * @param {Child[]} children
 */
function fill(element, children) {
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
}

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Props} [props]
 * @param {...Child} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  assign(element, props);
  fill(element, children);
  return element;
}

/** A text in which `what is typed` stands as such. @param {string} text */
export const coded = (text) => text.split(/`([^`]*)`/).map((part, place) => (place % 2 ? h("code", {}, part) : part));

/** A control with its label, and what is said of it below. @param {string} id @param {string} label @param {HTMLElement} control @param {string} [hint] */
export function field(id, label, control, hint) {
  control.id = id;
  if (hint) control.setAttribute("aria-describedby", `${id}-hint`);
  return h("div", { class: "field" }, h("label", { for: id }, label), control, hint && h("span", { class: "hint", id: `${id}-hint` }, hint));
}

/**
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} tag
 * @param {Props} [props]
 * @param {...Child} children
 * @returns {SVGElementTagNameMap[K]}
 */
export function s(tag, props = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  assign(element, props);
  fill(element, children);
  return element;
}

/**
 * A custom element of this page, with its properties set.
 * @template {HTMLElement} T
 * @param {new () => T} type
 * @param {Partial<T>} [properties]
 * @returns {T}
 */
export function make(type, properties = {}) {
  return Object.assign(new type(), properties);
}

/** So long a redraw waits for a press at most. */
const LONGEST_PRESS_MS = 5000;
const FOCUSED = "a, button, input, select, textarea, summary, [tabindex]";
/** Whether a button or key is held down. */
let isPressed = false;
/** @typedef {readonly Child[] | (() => readonly Child[])} Children those of a function are made as they are drawn */
/** What is to be drawn once it is let go, and where. @type {Map<Element, Children>} */
const waiting = new Map();
/** What waits to draw in another way. @type {(() => void)[]} */
const released = [];
let timer = 0;

/** @param {number} [after_ms] */
function letGo(after_ms = 0) {
  clearTimeout(timer);
  timer = window.setTimeout(() => {
    isPressed = false;
    for (const [parent, children] of [...waiting]) putChildren(parent, children);
    for (const go of released.splice(0)) go();
  }, after_ms);
}
for (const kind of ["pointerdown", "keydown"]) {
  window.addEventListener(kind, () => {
    isPressed = true;
    letGo(LONGEST_PRESS_MS);
  }, true);
}
for (const kind of ["pointerup", "pointercancel", "keyup", "change"]) window.addEventListener(kind, () => letGo(), true);
window.addEventListener("click", () => (isPressed = false), true); // it has come: what it draws itself is drawn at once

/** Done once nothing is being pressed, or after some time: what comes many times a second must not look lost. @param {number} longest_ms @returns {Promise<void>} */
export function whenLetGo(longest_ms) {
  if (!isPressed) return Promise.resolve();
  return new Promise((go) => {
    released.push(go);
    window.setTimeout(go, longest_ms);
  });
}

/** By what somebody knows a control again that was drawn anew. @param {HTMLElement | SVGElement} one */
function known(one) {
  const own = [one.id, ...Object.values(one.dataset)].join("");
  return `${one.localName} ${own || one.ariaLabel || (one.localName === "select" ? "" : one.textContent) || one.getAttribute("class")}`;
}

/** @param {Element} parent @param {string} selector @param {HTMLElement | SVGElement} one @returns {(HTMLElement | SVGElement)[]} */
const alike = (parent, selector, one) => /** @type {(HTMLElement | SVGElement)[]} */ ([...parent.querySelectorAll(selector)]).filter((other) => known(other) === known(one));

/**
 * Draw an element's children anew: those that it has already stay, what is open stays open, and the focus goes to what
 * stands for the control that had it. While something is being pressed nothing is drawn: it must neither be replaced nor
 * move away below the pointer.
 * @param {Element} parent
 * @param {Children} children
 */
export function putChildren(parent, children) {
  waiting.delete(parent);
  if (isPressed) return void waiting.set(parent, children);
  const { activeElement } = document;
  const focused = /** @type {HTMLElement | null} */ (parent.contains(activeElement) ? activeElement : null);
  const place = focused ? alike(parent, FOCUSED, focused).indexOf(focused) : -1;
  const open = [...parent.querySelectorAll("details[open] > summary")].map(({ textContent }) => textContent);
  const nodes = (typeof children === "function" ? children() : children).flatMap((child) => (child === null || child === undefined || child === false ? [] : child instanceof Node ? child : new Text(String(child))));
  for (const child of [...parent.childNodes]) if (!nodes.some((one) => one === child)) child.remove();
  nodes.forEach((child, at) => {
    const there = parent.childNodes[at] ?? null;
    if (there !== child) parent.insertBefore(child, there);
  });
  for (const summary of parent.querySelectorAll("details:not([open]) > summary")) if (open.includes(summary.textContent)) summary.parentElement?.setAttribute("open", "");
  if (focused && !focused.isConnected) alike(parent, FOCUSED, focused)[place]?.focus({ preventScroll: true });
}

/** The styles of a part that is loaded when it is asked for; answers once they are there. @param {string} name @returns {Promise<unknown>} */
export function style(name) {
  return new Promise((resolve) => {
    document.head.append(h("link", { rel: "stylesheet", href: new URL(`./styles/${name}.css`, import.meta.url).href, onload: resolve, onerror: resolve }));
  });
}

/**
 * Keep the children of `parent` in step with `items`: an item with a known key keeps its element, and the focus in it.
 * @template T
 * @param {Element} parent
 * @param {readonly T[]} items
 * @param {(item: T) => string} key
 * @param {(item: T) => Element} create
 * @param {(element: Element, item: T) => void} update
 */
export function keyed(parent, items, key, create, update) {
  /** @type {Map<string, Element>} */
  const old = new Map();
  for (const child of parent.children) old.set(child.getAttribute("data-key") ?? "", child);
  let previous = /** @type {Element | null} */ (null);
  for (const item of items) {
    const name = key(item);
    let element = old.get(name);
    if (!element) {
      element = create(item);
      element.setAttribute("data-key", name);
    }
    old.delete(name);
    update(element, item);
    const place = previous ? previous.nextElementSibling : parent.firstElementChild;
    if (place !== element) parent.insertBefore(element, place);
    previous = element;
  }
  for (const element of old.values()) element.remove();
}

/**
 * The one element that `selector` finds; its absence is a defect of the page.
 * @template {Element} T
 * @param {ParentNode} parent
 * @param {string} selector
 * @param {new () => T} type
 * @returns {T}
 */
export function find(parent, selector, type) {
  const element = parent.querySelector(selector);
  if (!(element instanceof type)) throw new Error(`the page lacks ${selector}`);
  return element;
}
