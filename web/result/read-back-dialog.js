// The tool as it stands in the controller, of a file or as typed, compared with the answer: equal, or what differs.

import "../texts/later.js";
import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { field, h } from "../dom.js";
import { fixed } from "../format.js";
import { mark } from "../icons.js";
import { chosen } from "../state/files.js";
import { conventions } from "../state/registries.js";
import { said, t } from "../texts.js";
import { conventionWords } from "../measure/pose-columns.js";
import { formButtons, openDialog } from "../components/dialog.js";
import { attempt } from "../components/toasts.js";

/** @import {ToolComparison} from "../state/model.js" */

/** @param {string} sessionId */
export function readBackDialog(sessionId) {
  const outcome = h("div", { role: "status", class: "read-back" });
  const files = h("input", { type: "file", multiple: true, onchange: () => void listTools() });
  const tool = h("select", {});
  const numbers = h("input", { type: "text", autocomplete: "off", placeholder: "0 0 184 0 45 0", spellcheck: false, oninput: () => numbers.setCustomValidity("") });
  const convention = h("select", {}, h("option", { value: "" }, t("read_back.session")));
  const which = field("read-back-tool", t("read_back.tool"), tool);
  which.hidden = true;

  let latest = 0; // answers may come in another order than they were asked for
  const listTools = async () => {
    outcome.replaceChildren();
    which.hidden = true;
    const found = chosen(files);
    if (!found.length) return;
    numbers.value = "";
    await attempt(async () => {
      const { tools } = await api.readControllerFiles(found);
      tool.replaceChildren(...tools.map(({ number, name }) => h("option", { value: String(number ?? name) }, [number, name].filter((part) => part !== null && part !== "").join(" "))));
      which.hidden = tools.length < 2;
    });
  };
  const compare = async () => {
    const found = numbers.value.trim() ? [] : chosen(files);
    /** @type {Record<string, string>} */
    const asked = found.length ? { tool: tool.value } : { numbers: numbers.value, convention: convention.value };
    numbers.setCustomValidity(found.length || numbers.value.trim() ? "" : t("read_back.need"));
    if (!numbers.reportValidity()) return;
    outcome.replaceChildren(h("p", { class: "soft" }, t("comparison.wait")));
    const comparison = ++latest;
    /** @type {HTMLElement[]} */
    let answer;
    try {
      answer = shown(await api.readBack(sessionId, found, asked));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      answer = [h("p", { class: "form-problem" }, error.message)];
    }
    if (comparison === latest) outcome.replaceChildren(...answer);
  };
  openDialog("read-back", t("read_back.title"), [
    h("p", { class: "soft" }, t("read_back.how")),
    field("read-back-files", t("read_back.files"), files), which,
    field("read-back-numbers", t("read_back.numbers"), numbers), field("read-back-convention", t("read_back.convention"), convention),
    outcome, formButtons(t("result.compare"), t("close")),
  ], { submit: compare });
  void attempt(async () => convention.append(...(await conventions()).map((one) => h("option", { value: one.name }, conventionWords(one)))));
}

/** @param {ToolComparison} found */
function shown({ equal, words, position_mm: position, rotation_deg: rotation, faults }) {
  const apart = position === null || rotation === null ? "" : t("read_back.apart", { position: fixed(position, 3), rotation: fixed(rotation, 4) });
  return [h("p", {}, mark(!equal ? "fail" : faults.length ? "warn" : "pass", said(words))), h("p", { class: "soft" }, apart)];
}
