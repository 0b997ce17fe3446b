// How far something is that takes a while: words always, a bar where its length is known.

import { h } from "../dom.js";

export class ProgressElement extends HTMLElement {
  #bar = h("progress", { max: 1, "aria-hidden": "true", hidden: true });
  #words = h("span", {});

  connectedCallback() {
    if (this.firstChild) return;
    this.className = "busy";
    this.hidden = true;
    this.setAttribute("role", "status");
    this.append(this.#bar, this.#words);
  }

  /**
   * @param {string} words
   * @param {number} [share] from 0 to 1
   */
  show(words, share) {
    this.hidden = false;
    this.#bar.hidden = share === undefined;
    if (share !== undefined) this.#bar.value = share;
    if (this.#words.textContent !== words) this.#words.textContent = words;
  }

  end() {
    this.hidden = true;
    this.#words.textContent = "";
  }
}

customElements.define("sc-progress", ProgressElement);
