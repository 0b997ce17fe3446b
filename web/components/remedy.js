// What mends a failed result at once: where its warnings name another pose convention, reading the poses in that one.

import { api } from "../state/api.js";
import { conventions } from "../state/registries.js";
import { did } from "../state/undo.js";
import { maybe, t } from "../texts.js";
import { attempt } from "./toasts.js";

/** @import {StageResult} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */
/** @typedef {{ name: string, words: string, mend: () => Promise<unknown> }} Remedy */

/** What stands in quotes in a failed result's warnings. @param {StageResult} result */
export const quotedIn = ({ verdict, stale, warnings }) => new Set(verdict === "fail" && !stale ? (warnings ?? []).flatMap((text) => [...text.matchAll(/'([a-z0-9-]+)'/g)].map(([, name]) => name)) : []);

/** @param {SessionState} state @param {string} stage @param {StageResult} result @returns {Promise<Remedy[]>} */
export async function remedies(state, stage, result) {
  const quoted = quotedIn(result);
  if (!quoted.size) return [];
  const before = state.session?.cell.pose_convention;
  return (await conventions()).filter(({ name }) => quoted.has(name) && name !== before).map(({ name }) => ({
    name: maybe(`convention.${name}`, name),
    words: t("remedy.convention", { convention: maybe(`convention.${name}`, name) }),
    mend: () => attempt(async () => {
      const set = (/** @type {string | undefined} */ convention) => api.changeSession(state.id, { cell: { pose_convention: convention } });
      await set(name);
      did(t("cell.changed"), () => set(before), { redo: () => set(name) });
      state.follows(await api.solve(state.id, stage));
    }),
  }));
}
