// The 3-D scene beside everything: its own document from the same server, in this page's theme, with its controls above.

import { api } from "../state/api.js";
import { randomName } from "../state/http.js";
import { h, putChildren } from "../dom.js";
import { icon } from "../icons.js";
import { theme, whenThemeChanges } from "../theme.js";
import { said, t } from "../texts.js";
import { sayer } from "./scene-words.js";
import { StateElement } from "../components/base.js";
import { attempt, notify } from "../components/toasts.js";

/** @import {SceneControls} from "../state/model.js" */

const STEP_MS = 900;
const LARGEST_PX = 4096;
/** Where the scene's client stores what was clicked in it; its own beginning of the key is not ours. */
const PICKED_KEY = "scancell-picked";
/** The same of a point of the merged surface: its three coordinates in the cloud's frame. */
const SURFACE_KEY = "scancell-surface";

const ASK_AGAIN_MS = 700;
const MOST_ASKED = 400; // where the disk is slow, the first scene is opened within minutes

/** @typedef {{ scancellScene?: { show(layers: Record<string, boolean>): void, speak(say: (text: string) => string): void } }} SceneWindow */

export class SceneElement extends StateElement {
  #frame = h("iframe", { title: t("scene.title"), onload: () => void this.#tellStory() });
  #views = h("select", { "aria-label": t("view.label"), onchange: () => this.#look() }, h("option", { value: "" }, t("scene.view_choose")));
  #layers = h("fieldset", { class: "scene-layer-list" }, h("legend", { class: "visually-hidden" }, t("scene.layers")));
  #play = h("button", { type: "button", class: "scene-play", onclick: () => this.#toggle() });
  #picture = h("button", { type: "button", class: "plain wide", onclick: () => void this.#download() }, t("scene.picture"));
  #large = h("button", { type: "button", class: "icon", "aria-label": t("scene.large"), title: t("scene.large"), onclick: () => void this.#enlarge() }, icon("large"));
  #page = h("a", { class: "button plain wide", download: "" }, t("scene.page"));
  /** This page's name in its scene: another page beside it has its own camera. */ #viewer = randomName();
  #shown = "";
  #learnt = 0;
  #offered = "";
  #story = "";
  #telling = 0;
  #shownLayers = /** @type {Record<string, boolean>} */ ({});
  #timer = 0;
  #place = -1;
  /** @type {(() => void) | null} */ #stopTheme = null;
  /** @type {string | null} */ #lit = null;

  parts = /** @type {const} */ (["session", "guide", "selection", "place", "step", "view", "live"]);

  build() {
    const tools = h("div", { class: "scene-tools", role: "group", "aria-label": t("scene.tools"), onpointerenter: () => this.#learn(), onfocusin: () => this.#learn() },
      this.#views, folded(t("scene.layers"), this.#layers), this.#play, folded(t("scene.save"), h("div", { class: "scene-layer-list" }, this.#picture, this.#page)), this.#large);
    this.append(
      tools,
      h("div", { class: "scene-frame" }, h("p", { class: "scene-wait soft" }, t("scene.wait")), this.#frame));
    this.#showPlay();
  }

  connectedCallback() {
    super.connectedCallback();
    this.#stopTheme = whenThemeChanges(() => this.#show());
    window.addEventListener("storage", this.#picked);
  }

  disconnectedCallback() {
    super.disconnectedCallback();
    this.#stopTheme?.();
    window.removeEventListener("storage", this.#picked);
    window.clearInterval(this.#timer);
  }

  /** @param {ReadonlySet<import("../state/session.js").Part>} changed */
  update(changed) {
    if (changed.has("live") && this.state.live === "live" && this.#shown) this.#reconnect();
    this.#move();
    this.#show();
    const { step, view } = this.state;
    if (`${step} ${view}` !== this.#story && this.#shown && step) {
      this.#story = `${step} ${view}`;
      void this.#tellStory();
    }
    if (this.#lit === this.state.selected) return;
    this.#lit = this.state.selected;
    // The scene is an extra: where it cannot light the capture up, the list and the plot still do.
    void this.#tell("highlight", { capture: this.#lit }).catch(() => undefined);
  }

  /** A server that was away knows nothing of this page's scene: its client connects by itself, its story is told anew. */
  #reconnect() {
    if (!this.#drawn) this.#shown = ""; // the frame holds what a browser shows for a page that it cannot load
    this.#story = this.#offered = "";
    this.#lit = null;
    this.#place = -1;
  }

  get #scene() {
    return this.state.session?.scene ?? "";
  }

  /** @param {string} what @param {Record<string, unknown>} body */
  #tell(what, body) {
    return api.tellScene(this.#scene, what, body);
  }

  /**
   * Choosing a step or its result sets camera, layers and legend to what it is about. Once the scene's page is there, its
   * connection to the server may still be on its way; a scene that never comes is asked nothing.
   */
  async #tellStory() {
    const { state } = this;
    if (!this.#shown || !state.step) return;
    const telling = ++this.#telling;
    await this.#whenOpen(async () => {
      if (telling !== this.#telling) return;
      const told = await api.sceneStory(this.#scene, this.#viewer, state.step, state.view);
      if (telling !== this.#telling) return;
      if (!told.open || !this.#showLayers(told.layers)) throw new Error("not open yet");
      this.#learn();
      state.tell("scene");
      // What was picked before there was a scene lights up as well.
      if (this.#lit) await this.#tell("highlight", { capture: this.#lit }).catch(() => undefined);
    });
  }

  /** Do what needs the scene's connection, as soon as that is there. @param {() => Promise<unknown>} act */
  async #whenOpen(act) {
    for (let asked = 0; asked < MOST_ASKED && this.isConnected && this.#drawn; asked++) {
      if (await act().then(() => true, () => false)) return;
      await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
    }
  }

  /** What the scene's page offers, once it is loaded. */
  get #drawn() {
    // Of a page that could not be loaded there is no document.
    return this.#frame.contentDocument ? /** @type {SceneWindow | null} */ (/** @type {unknown} */ (this.#frame.contentWindow))?.scancellScene : undefined;
  }

  /** The legend in the page's language, as far as it is known by now. */
  #speak = () => {
    if (!this.#say) return;
    this.#drawn?.speak?.(this.#say);
    for (const one of this.#views.options) if (one.value) one.textContent = this.#say(one.value);
  };

  #say = sayer(this.#speak);

  /** Which layers this page's scene shows; answers whether the scene is there to hear it. @param {Record<string, boolean>} layers */
  #showLayers(layers) {
    if (!this.#drawn) return false;
    this.#shownLayers = layers;
    this.#drawn.show(layers);
    this.#speak();
    for (const box of this.#layers.querySelectorAll("input")) box.checked = layers[box.name] ?? true;
    return true;
  }

  /** A page that reviews the past takes its own scene along. */
  #move() {
    const place = "place" in this.state && typeof this.state.place === "number" ? this.state.place : -1;
    if (place < 0 || place === this.#place) return;
    this.#place = place;
    void this.#tell("moment", { place }).catch(() => undefined);
  }

  #show() {
    const scene = this.#scene;
    if (!scene || ("place" in this.state && this.#place < 0)) return;
    const address = `${scene}viewers/${this.#viewer}/?theme=${theme()}`;
    if (address === this.#shown) return;
    this.#shown = address;
    this.#story = "";
    this.#frame.src = address;
    this.#page.href = `${scene}page`;
    this.#learn();
  }

  /** What there is to look at and to show by now: it changes with captures and results. */
  #learn() {
    if (Date.now() < this.#learnt + ASK_AGAIN_MS || !this.#scene) return;
    this.#learnt = Date.now();
    void api.sceneControls(this.#scene).then((controls) => this.#offer(controls)).catch(() => undefined);
  }

  /** @param {SceneControls} controls */
  #offer({ views, layers }) {
    const told = JSON.stringify([views, layers.map(({ name }) => name)]);
    if (told === this.#offered) return;
    this.#offered = told;
    this.#views.replaceChildren(h("option", { value: "" }, t("scene.view_choose")), ...views.map((view) => h("option", { value: view }, this.#say?.(view) ?? view)));
    putChildren(this.#layers, [h("legend", { class: "visually-hidden" }, t("scene.layers")), ...layers.map(({ name, title, shown }) => {
      const box = h("input", { type: "checkbox", name, ".checked": this.#shownLayers[name] ?? shown, onchange: () => this.#showLayers({ ...this.#shownLayers, [name]: box.checked }) });
      return h("label", {}, box, ` ${said(title)}`);
    })]);
  }

  #look() {
    const view = this.#views.value;
    this.#views.value = "";
    if (!view) return;
    if (this.#drawn) void this.#whenOpen(() => this.#tell(`viewers/${this.#viewer}/view`, { view }));
    else notify(t("scene.wait"));
  }

  async #enlarge() {
    if (document.fullscreenElement) await document.exitFullscreen();
    else await this.requestFullscreen?.().catch(() => undefined); // where the browser does not allow it, nothing changes
  }

  #toggle() {
    const plays = this.#timer !== 0;
    window.clearInterval(this.#timer);
    this.#timer = 0;
    if (plays) this.#turn(null);
    else {
      this.#next();
      this.#timer = window.setInterval(() => this.#next(), STEP_MS);
    }
    this.#showPlay();
  }

  /** Turn the cell to the next capture; it lights up in table and plots as well. */
  #next() {
    const ids = this.state.captures.filter((capture) => capture.pose).map((capture) => capture.id);
    const next = ids[(ids.indexOf(this.state.selected ?? "") + 1) % ids.length];
    if (next === undefined) return;
    if (this.state.selected !== next) this.state.select(next);
    this.#turn(next);
  }

  /** A scene that is not there turns nothing; table and plots go on. @param {string | null} capture */
  #turn(capture) {
    if (this.#drawn) void this.#tell("turn", { capture }).catch(() => undefined);
  }

  #showPlay() {
    const words = t(this.#timer ? "scene.pause" : "scene.play");
    this.#play.replaceChildren(icon(this.#timer ? "pause" : "play"), h("span", { class: "word" }, words));
    this.#play.setAttribute("aria-label", words);
  }

  async #download() {
    if (!this.#drawn) return void notify(t("scene.wait"));
    this.#picture.setAttribute("aria-disabled", "true");
    this.#picture.textContent = t("scene.drawing");
    await attempt(async () => {
      const { clientWidth, clientHeight } = this.#frame;
      const times = Math.min(window.devicePixelRatio, LARGEST_PX / Math.max(clientWidth, clientHeight, 1));
      const image = await api.scenePicture(this.#scene, this.#viewer, Math.max(64, Math.round(clientWidth * times)), Math.max(64, Math.round(clientHeight * times)));
      const link = h("a", { href: URL.createObjectURL(image), download: `scene-${this.state.id}.png` });
      link.click();
      window.setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    });
    this.#picture.textContent = t("scene.picture");
    this.#picture.removeAttribute("aria-disabled");
  }

  /** What was clicked in this page's scene. @param {StorageEvent} event */
  #picked = (event) => {
    const [viewer, ...words] = (event.newValue ?? "").replaceAll('"', "").split(" ");
    if (viewer !== this.#viewer || !words[0]) return;
    if (event.key?.endsWith(PICKED_KEY)) this.state.select(words[0]);
    if (event.key?.endsWith(SURFACE_KEY)) this.state.touch(words.slice(0, 3).map(Number));
  };
}

/** What opens below a button, and closes with Escape. @param {string} words @param {HTMLElement} content */
function folded(words, content) {
  const details = h("details", { class: "scene-layers" }, h("summary", { class: "button" }, words), content);
  details.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !details.open) return;
    details.open = false;
    details.querySelector("summary")?.focus();
  });
  return details;
}

customElements.define("sc-scene", SceneElement);
