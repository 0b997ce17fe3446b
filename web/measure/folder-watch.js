// A folder on the server whose files become captures: chosen here, and followed while it is watched.

import { api } from "../state/api.js";
import { field, h, putChildren } from "../dom.js";
import { mark } from "../icons.js";
import { plural, said, t } from "../texts.js";
import { StateElement } from "../components/base.js";
import { stepName } from "./rail.js";
import { attempt } from "../components/toasts.js";

/** @import {FolderState, FolderWatch} from "../state/model.js" */

const LOOK_EVERY_MS = 2000;

export class FolderWatchElement extends StateElement {
  /** @type {FolderState | null} */ #now = null;
  #timer = 0;
  #told = "";
  #open = false;
  #folder = h("select", {});
  #step = h("select", {});
  #panel = h(
    "section", { class: "panel", "aria-labelledby": "watch-title", hidden: true },
    h("div", { class: "row spread" }, h("h2", { id: "watch-title" }, t("watch.title")), h("button", { type: "button", class: "plain", onclick: () => this.#close() }, t("close"))),
    h("p", { class: "soft" }, t("watch.how")),
    field("watch-folder", t("watch.folder"), this.#folder),
    field("watch-step", t("intake.step"), this.#step),
    h("div", { class: "row end" }, h("button", { type: "button", class: "primary", needs: "capture", onclick: () => void this.#begin() }, t("watch.go"))),
  );
  #none = h("p", { class: "panel", hidden: true }, t("watch.unavailable"));
  #status = h("section", { class: "panel watch-status", "aria-label": t("watch.title"), "aria-live": "polite", hidden: true });

  parts = /** @type {const} */ (["session", "captures"]);

  build() {
    this.append(this.#panel, this.#none, this.#status);
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    window.clearTimeout(this.#timer);
  }

  update() {
    if (this.state.session && !this.state.session.simulated) void this.#look();
  }

  async open() {
    this.#open = true;
    await attempt(() => this.#load());
    const { step, captureSteps } = this.state;
    this.#step.replaceChildren(...captureSteps.map((one) => h("option", { value: one, selected: one === step }, stepName(this.state, one))));
    this.#show();
    if (this.#now?.available) this.#folder.focus();
  }

  #close() {
    this.#open = false;
    this.#show();
  }

  async #load() {
    this.#now = await api.folder(this.state.id);
    this.#show();
  }

  /** Look now, and again for as long as a folder is watched; a lost connection is told elsewhere. */
  async #look() {
    window.clearTimeout(this.#timer);
    await this.#load().catch(() => undefined);
    if (this.#now?.watch && this.isConnected) this.#timer = window.setTimeout(() => void this.#look(), LOOK_EVERY_MS);
  }

  async #begin() {
    const went = await attempt(async () => { this.#now = await api.watchFolder(this.state.id, this.#folder.value, this.#step.value); });
    if (!went) return;
    this.#open = false;
    this.#show();
    void this.#look();
  }

  async #end() {
    await attempt(async () => {
      await api.endWatching(this.state.id);
      await this.#load();
    });
  }

  #show() {
    const now = this.#now;
    const available = now?.available === true;
    this.#panel.hidden = !this.#open || !available || now.watch !== null;
    this.#none.hidden = !this.#open || now === null || available;
    if (!this.#panel.hidden && this.#folder.childElementCount !== now?.folders.length) {
      this.#folder.replaceChildren(...(now?.folders ?? []).map((folder) => h("option", { value: folder }, folder === "." ? t("watch.root") : folder)));
    }
    this.#status.hidden = !now?.watch;
    const told = JSON.stringify(now?.watch ?? null);
    if (!now?.watch || told === this.#told) return;
    this.#told = told;
    putChildren(this.#status, status(now.watch, () => void this.#end()));
  }
}

/** @param {FolderWatch} watch @param {() => void} end */
function status(watch, end) {
  return [
    h("div", { class: "row spread" },
      h("p", {}, mark("working", t("watch.watching", { folder: watch.folder === "." ? t("watch.root") : watch.folder })), " · ", plural(watch.taken, "captures.one", "captures.many")),
      h("button", { type: "button", needs: "capture", onclick: end }, t("watch.end"))),
    watch.problem ? h("p", {}, mark("fail", said(watch.problem))) : null,
    watch.waiting.length ? h("p", { class: "soft" }, t("watch.waiting", { files: watch.waiting.slice(0, 5).join(", ") })) : null,
    watch.refused.length ? h("ul", {}, ...watch.refused.slice(0, 5).map(({ reason }) => h("li", { class: "reason reason-fail" }, said(reason)))) : null,
  ];
}

customElements.define("sc-folder-watch", FolderWatchElement);
