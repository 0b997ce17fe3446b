// What dialogs have in common: they are gone once they are closed, and say in themselves what the server refuses.

import { h } from "../dom.js";
import { Problem } from "../state/http.js";
import { t } from "../texts.js";

/** @typedef {import("../dom.js").Child} Child */
/** @typedef {(event: SubmitEvent) => unknown} Submit */

/**
 * Open a dialog below its title; with `submit` what it holds is a form.
 * @param {string} id begins the id of the title
 * @param {string} title
 * @param {Child[]} children
 * @param {{ submit?: Submit, class?: string }} [options]
 */
export function openDialog(id, title, children, { submit, class: kind } = {}) {
  const holds = [h("h2", { id: `${id}-title` }, title), ...children];
  const body = submit ? h("form", { class: "body", novalidate: true, onsubmit: once(submit) }, ...holds) : h("div", { class: "body" }, ...holds);
  return showDialog(h("dialog", { class: kind, "aria-labelledby": `${id}-title` }, body));
}

/** What a form sends, once, however often its button is pressed meanwhile. @param {Submit} send */
export function once(send) {
  let isOnItsWay = false;
  return async (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    if (isOnItsWay) return;
    isOnItsWay = true;
    try {
      await send(event);
    } finally {
      isOnItsWay = false;
    }
  };
}

/** It goes with its page too, as where somebody goes back. @param {HTMLDialogElement} dialog */
export function showDialog(dialog) {
  const close = () => dialog.close();
  window.addEventListener("popstate", close);
  dialog.addEventListener("close", () => {
    window.removeEventListener("popstate", close);
    dialog.remove();
  });
  document.body.append(dialog);
  dialog.showModal();
  return dialog;
}

/** A button that closes the dialog that it stands in. @param {string} [words] @param {import("../dom.js").Props} [props] */
export const closeButton = (words = t("cancel"), props = {}) =>
  h("button", { type: "button", onclick: (/** @type {Event} */ { target }) => /** @type {Element} */ (target).closest("dialog")?.close(), ...props }, words);

/** The buttons below: what closes, and what sends the form. @param {string} go @param {string} [close] */
export const formButtons = (go, close) => h("div", { class: "row end" }, closeButton(close), h("button", { type: "submit", class: "primary" }, go));

/** A place for what the server refuses; `during` does what it may refuse, and answers whether it went well. */
export function alarm() {
  const element = h("p", { class: "form-problem", role: "alert", hidden: true });
  /** @param {string} words */
  const show = (words) => {
    element.textContent = words;
    element.hidden = words === "";
  };
  /** @param {() => unknown} action */
  const during = async (action) => {
    show("");
    try {
      await action();
      return true;
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      show(error.message);
      return false;
    }
  };
  return { element, show, during };
}

/** Have the browser save what was fetched. @param {Blob} content @param {string} name */
export function saveFile(content, name) {
  const link = h("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}
