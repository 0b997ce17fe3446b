// A button that copies a text and says that it did.

import { h } from "../dom.js";
import { icon } from "../icons.js";
import { t } from "../texts.js";
import { notify } from "./toasts.js";

/**
 * @param {string} text
 * @param {string} label
 */
export function copyButton(text, label) {
  return h("button", { type: "button", class: "copy", onclick: () => void copy(text) }, icon("copy"), label);
}

/** @param {string} text */
export async function copy(text) {
  // The browser may refuse, as where another window has the focus.
  const written = navigator.clipboard ? await navigator.clipboard.writeText(text).then(() => true, () => false) : false;
  if (!written) {
    // Without a secure context (another machine's plain address) only the old way works.
    const area = h("textarea", { ".value": text, class: "visually-hidden" });
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  notify(t("copied"));
}
