// What every component of the session page has in common: it watches the parts of the state that it shows.

import { SessionState } from "../state/session.js";

/** @import {Part} from "../state/session.js" */

export class StateElement extends HTMLElement {
  /** @type {SessionState | null} */ #state = null;
  /** @type {(() => void) | null} */ #stop = null;

  /** What of the state it shows. @type {readonly Part[]} */ parts = [];

  /** The session's state; the page sets it before the element is shown. */
  get state() {
    if (!this.#state) throw new Error(`${this.localName} was shown without a state`);
    return this.#state;
  }

  set state(state) {
    this.#state = state;
  }

  connectedCallback() {
    if (!this.firstChild) this.build();
    this.#stop = this.state.watch(this.parts, (changed) => this.update(changed));
  }

  disconnectedCallback() {
    this.#stop?.();
  }

  /** Make what stays. */
  build() {}

  /**
   * Show what changed.
   * @param {ReadonlySet<Part>} _changed
   */
  update(_changed) {}
}
