// Who uses this page, and what the page may offer them. The server decides; this only says it beforehand.

import { api } from "./api.js";
import { toLogin } from "./http.js";
import { t } from "../texts.js";

/** @import {Me} from "./model.js" */
/** @typedef {"capture" | "release" | "admin"} Role */

const RANKS = { read: 1, capture: 2, release: 3, admin: 4 };

/** @type {Me} */
let known = { name: "", role: "admin", login: "not-needed" };

/** Ask the server who one is; where it cannot be reached, the page itself will say so. */
export async function learn() {
  known = await api.me().catch(() => known);
}

export const me = () => known;

/** @param {Role} role */
export const may = (role) => known.role !== null && RANKS[known.role] >= RANKS[role];

/**
 * Offer a control to those with a role alone; for others it stays where it is, disabled, and says why.
 * @param {Role} role
 * @param {Element} control
 */
export function only(role, control) {
  if (may(role)) return;
  const reason = t(`may.${role}`);
  control.setAttribute("aria-disabled", "true");
  control.setAttribute("aria-description", reason);
  control.addEventListener("pointerenter", () => control.setAttribute("title", reason));
  control.addEventListener("click", (event) => {
    event.preventDefault();
    event.stopImmediatePropagation();
    refused(reason);
  }, { capture: true });
}

/** Whether one may go on with something; says so where not. @param {Role} role */
export function allowed(role) {
  if (!may(role)) refused(t(`may.${role}`));
  return may(role);
}

/** @type {(reason: string) => void} */
let refused = () => undefined;

/** Say where it is shown that something may not be done. @param {(reason: string) => void} show */
export function whenRefused(show) {
  refused = show;
}

/** A stream broke off: if that is because the login ended, log in again. */
export async function requireLogin() {
  if (known.login === "not-needed") return;
  await learn();
  if (known.role === null) toLogin();
}
