// Both answers of a comparison in one scene: the scanner as either puts it, and where the two put one point of the workpiece.

import { api } from "../state/api.js";
import { randomName } from "../state/http.js";
import { h } from "../dom.js";
import { theme } from "../theme.js";
import { t } from "../texts.js";

/** @import {Comparison} from "../state/model.js" */
/** @typedef {{ scancellScene?: { show(layers: Record<string, boolean>): void } }} SceneWindow */

const [ASK_AGAIN_MS, MOST_ASKED] = [700, 400];

/** @param {Comparison} comparison */
export function bothAnswers({ stage, frames, left, right }) {
  // What was only recomputed is no session's result: there is no scene to show it in.
  if (!frames.length || !left.session || !right.session) return null;
  const [own, viewer] = [randomName(), randomName()];
  const scene = `/scenes/${encodeURIComponent(left.session)}.${own}/`;
  const frame = h("iframe", { title: t("comparison.scene"), onload: () => void tell(frame, scene, viewer) });
  const figure = h("figure", { class: "both-answers" }, h("div", { class: "scene-frame" }, h("p", { class: "scene-wait soft" }, t("scene.wait")), frame), h("figcaption", { class: "soft small" }, t("comparison.scene_what")));
  // Without the scene the figures tell the same.
  void api.tellScene(scene, "compared", { stage, left: nameOf(left), right: nameOf(right) }).then(() => { frame.src = `${scene}viewers/${viewer}/?theme=${theme()}`; }).catch(() => figure.remove());
  return figure;
}

/** @param {Comparison["left"]} side */
const nameOf = ({ session, number }) => (number ? `${session}:${number}` : session);

/** Camera, layers and legend, once the scene's own connection stands. @param {HTMLIFrameElement} frame @param {string} scene @param {string} viewer */
async function tell(frame, scene, viewer) {
  for (let asked = 0; asked < MOST_ASKED && frame.isConnected && frame.src; asked++) {
    const drawn = /** @type {SceneWindow | null} */ (/** @type {unknown} */ (frame.contentWindow))?.scancellScene;
    const told = drawn && await api.sceneStory(scene, viewer, "compared", "result").catch(() => null);
    if (told?.open) return drawn?.show(told.layers);
    await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
  }
}
