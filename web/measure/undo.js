// Undo and redo as buttons, keys and notices offer them.

import { redo, undo, whenTold } from "../state/undo.js";
import { t } from "../texts.js";
import { attempt, notify, say } from "../components/toasts.js";

/** @import {Deed} from "../state/undo.js" */

/** @param {Deed} [deed] the last one where left out */
export async function undoLast(deed) {
  await attempt(async () => {
    const undone = await undo(deed);
    say(undone ? t("undo.done", { what: undone.text }) : t("undo.nothing"));
  });
}

export async function redoLast() {
  await attempt(async () => {
    const redone = await redo();
    say(redone ? t("redo.done", { what: redone.text }) : t("redo.nothing"));
  });
}

whenTold((deed) => void notify(deed.text, { undo: () => undoLast(deed) }));
