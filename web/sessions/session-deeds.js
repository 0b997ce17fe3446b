// What can be done with sessions from the list: rename one; save, archive or delete one or several. Loaded when it is asked for.

import "../texts/later.js";
import { api } from "../state/api.js";
import { field, h } from "../dom.js";
import { did } from "../state/undo.js";
import { plural, t } from "../texts.js";
import "../measure/undo.js";
import { closeButton, openDialog } from "../components/dialog.js";
import { attempt, notify } from "../components/toasts.js";

/** @import {SessionSummary} from "../state/model.js" */

/** @param {SessionSummary} session */
export const nameOf = (session) => session.name || session.id;

/** @param {string} title @param {(Node | string)[]} body @param {{ words: string, danger?: boolean, act: () => Promise<void> }} go */
function ask(title, body, { words, danger = false, act }) {
  const submit = async (/** @type {SubmitEvent} */ { target }) => {
    if (!/** @type {HTMLFormElement} */ (target).reportValidity()) return;
    dialog.close();
    await act();
  };
  const dialog = openDialog("deed", title, [...body, h("div", { class: "row end" },
    closeButton(t("cancel"), { autofocus: danger }), h("button", { type: "submit", class: danger ? "danger" : "primary" }, words))], { submit });
}

/** @param {readonly SessionSummary[]} sessions @param {() => Promise<void>} after */
export function removeSessions(sessions, after) {
  const [first] = sessions;
  if (!first) return;
  const captures = plural(sessions.reduce((sum, one) => sum + one.capture_count, 0), "captures.one", "captures.many");
  ask(sessions.length === 1 ? t("start.remove", { name: nameOf(first) }) : t("start.remove_several", { count: sessions.length }),
    [h("p", {}, t(sessions.length === 1 ? "start.remove_words" : "start.remove_several_words", { captures }))],
    { words: t("captures.delete"), danger: true, act: async () => {
      const gone = await attempt(async () => { for (const { id } of sessions) await api.removeSession(id); });
      if (gone) notify(sessions.length === 1 ? t("start.removed", { name: nameOf(first) }) : t("start.removed_several", { count: sessions.length }));
      await after();
    } });
}

/** @param {SessionSummary} session @param {() => Promise<void>} after */
export function renameSession(session, after) {
  const name = h("input", { required: true, maxlength: 200, autocomplete: "off", ".value": session.name });
  ask(t("start.rename", { name: nameOf(session) }), [field("session-name", t("name"), name)],
    { words: t("place.save"), act: async () => { if (await attempt(() => api.changeSession(session.id, { name: name.value.trim() }))) await after(); } });
  name.select();
}

/** Out of the list of those in use, or back into it. @param {readonly SessionSummary[]} sessions @param {boolean} archived @param {() => Promise<void>} after */
export async function archiveSessions(sessions, archived, after) {
  const set = (/** @type {boolean} */ value) => async () => {
    for (const { id } of sessions) await api.changeSession(id, { archived: value });
    await after();
  };
  if (!await attempt(set(archived))) return;
  did(plural(sessions.length, archived ? "start.archived_one" : "start.unarchived_one", archived ? "start.archived_many" : "start.unarchived_many"), set(!archived), { tell: true, redo: set(archived) });
}

/** One archive after the other, as the browser saves downloads. @param {readonly SessionSummary[]} sessions */
export async function saveArchives(sessions) {
  for (const { id } of sessions) {
    h("a", { href: api.archiveAddress(id), download: "" }).click();
    await new Promise((resolve) => setTimeout(resolve, 400));
  }
}
