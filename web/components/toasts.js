// Short notices with an optional way back, and the one place that screen readers are told of changes.

import { h } from "../dom.js";
import { icon } from "../icons.js";
import { t } from "../texts.js";
import { link, Problem } from "../state/http.js";

const SHOWN_MS = 9000;
/** More than this nobody reads: the newest stay. */
const AT_ONCE = 2;

class ToastsElement extends HTMLElement {
  #spoken = h("p", { class: "visually-hidden", "aria-live": "polite" });
  #alarm = h("p", { class: "visually-hidden", role: "alert" });
  #list = h("ol", { class: "toasts" });

  connectedCallback() {
    this.setAttribute("role", "region");
    this.setAttribute("aria-label", t("notices"));
    if (!this.firstChild) this.append(this.#spoken, this.#alarm, this.#list);
  }

  /** @param {string} text */
  say(text) {
    this.#spoken.textContent = text;
  }

  /**
   * @param {string} text
   * @param {{ undo?: () => Promise<void>, bad?: boolean }} [options]
   */
  show(text, { undo, bad = false } = {}) {
    (bad ? this.#alarm : this.#spoken).textContent = text;
    const close = () => void item.remove();
    const item = h("li", { class: bad ? "toast bad" : "toast" }, h("p", {}, text));
    if (undo) {
      const act = () => {
        close();
        void attempt(undo);
      };
      item.append(h("button", { type: "button", class: "undo", onclick: act }, t("undo")));
    }
    item.append(h("button", { type: "button", class: "plain icon", "aria-label": t("close"), onclick: close }, icon("close")));
    for (const same of [...this.#list.children].filter((one) => one.querySelector("p")?.textContent === text)) same.remove();
    this.#list.append(item);
    while (this.#list.children.length > AT_ONCE) this.#list.firstElementChild?.remove();
    if (!bad) window.setTimeout(close, SHOWN_MS);
    return close;
  }
}

customElements.define("sc-toasts", ToastsElement);

const toasts = new ToastsElement();

/** Between the page's head and its content, where they cover neither. @param {Element} content */
export function install(content) {
  content.before(toasts);
}

/** What failed, by the action; it is so no longer once the same one goes well, or another page is shown. @type {Map<string, { problem: Problem, close: () => void }>} */
const failures = new Map();

/** Take back the failures whose cause is gone. @param {(action: string, problem: Problem) => boolean} isGone */
export function forgive(isGone) {
  for (const [action, { problem, close }] of failures) {
    if (!isGone(action, problem)) continue;
    close();
    failures.delete(action);
  }
}

/** @type {(() => void) | null} */
let closeLost = null;
link.addEventListener("lost", () => { closeLost = toasts.show(t("link.lost"), { bad: true }); });
link.addEventListener("back", () => {
  closeLost?.();
  forgive((_, { status }) => status === 0);
});

/** @param {string} text */
export const say = (text) => toasts.say(text);

/**
 * Show a notice; answers what closes it.
 * @param {string} text
 * @param {{ undo?: () => Promise<void>, bad?: boolean }} [options]
 */
export const notify = (text, options) => toasts.show(text, options);

/**
 * Do something that may fail; a problem is shown with what to do about it. Answers whether it went well.
 * @param {() => Promise<unknown>} action
 */
export async function attempt(action) {
  try {
    await action();
    forgive((one) => one === String(action));
    return true;
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    if (error.status === 0) closeLost?.(); // one message for one cause
    failures.set(String(action), { problem: error, close: toasts.show(error.message, { bad: true }) });
    return false;
  }
}
