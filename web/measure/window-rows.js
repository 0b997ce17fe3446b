// Of a long table only the rows in sight, and some around them, stand in the page; a space stands for the others.

import { h } from "../dom.js";

/** Up to here all rows are there: styling, laying out and painting more of them takes longer than an eye waits. */
const MOST_ROWS = 80;
const AROUND = 12;
const LIKELY_HEIGHT_PX = 40;

export class WindowRows {
  /** @type {HTMLElement | null} */ #scroller = null;
  #before = space();
  #after = space();
  #first = 0;
  #waiting = 0;

  /** @param {HTMLTableSectionElement} body @param {() => void} changed called when other rows come into sight */
  constructor(body, changed) {
    this.body = body;
    this.changed = changed;
  }

  /** Follow what scrolls the table. @param {HTMLElement | null} scroller */
  follow(scroller) {
    this.leave();
    this.#scroller = scroller;
    scroller?.addEventListener("scroll", this.#scrolled, { passive: true });
  }

  leave() {
    this.#scroller?.removeEventListener("scroll", this.#scrolled);
    cancelAnimationFrame(this.#waiting);
  }

  /** How many of the rows that are drawn stand above those in sight. */
  get outOfSight() {
    return this.#before.isConnected ? Math.min(AROUND, this.#first) : 0;
  }

  /** Those of all rows that are to be drawn. @template T @param {readonly T[]} rows @returns {readonly T[]} */
  of(rows) {
    if (rows.length <= MOST_ROWS) {
      this.#before.remove();
      this.#after.remove();
      this.#first = 0;
      return rows;
    }
    if (!this.#before.isConnected) {
      this.body.before(this.#before);
      this.body.after(this.#after);
    }
    const height = this.#rowHeight;
    this.#first = Math.min(this.#wanted(height), Math.max(0, rows.length - this.#count(height)));
    const last = Math.min(rows.length, this.#first + this.#count(height));
    stretch(this.#before, this.#first * height);
    stretch(this.#after, (rows.length - last) * height);
    return rows.slice(this.#first, last);
  }

  get #rowHeight() {
    const { offsetHeight, children } = this.body;
    return children.length && offsetHeight ? offsetHeight / children.length : LIKELY_HEIGHT_PX;
  }

  /** @param {number} height of a row */
  #count(height) {
    return Math.ceil((this.#scroller?.clientHeight ?? 800) / height) + 2 * AROUND;
  }

  /** The first row to draw. @param {number} height of a row */
  #wanted(height) {
    const head = this.body.closest("table")?.tHead;
    const top = (this.#scroller?.getBoundingClientRect().top ?? 0) - (head?.getBoundingClientRect().bottom ?? 0);
    return Math.max(0, Math.floor(top / height) - AROUND);
  }

  #scrolled = () => {
    if (!this.#before.isConnected || this.#waiting) return;
    this.#waiting = requestAnimationFrame(() => {
      this.#waiting = 0;
      if (Math.abs(this.#wanted(this.#rowHeight) - this.#first) > AROUND / 2) this.changed();
    });
  };
}

const space = () => h("tbody", { class: "space", "aria-hidden": "true" }, h("tr", {}, h("td", { colspan: 20 })));

/** @param {HTMLElement} body @param {number} height_px */
function stretch(body, height_px) {
  body.hidden = height_px <= 0;
  const cell = body.querySelector("td");
  if (cell) cell.style.height = `${Math.round(height_px)}px`;
}
