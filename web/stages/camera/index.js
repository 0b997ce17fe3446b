// What the camera draws itself: each view's residuals as arrows, one view at a time or all laid over each other. The view is
// the capture that is picked, here as in tables, plots and scene.

import "../../texts/later.js";
import { arrowsOn, timesLonger } from "../../result/arrows.js";
import { StateElement } from "../../components/base.js";
import { field, h, make, s } from "../../dom.js";
import { fixed } from "../../format.js";
import { t } from "../../texts.js";

/** @import {Context} from "../../blocks/index.js" */
/** @import {Block, CameraResult} from "../../state/model.js" */

class CameraResidualsElement extends StateElement {
  /** @type {CameraResult | null} */ result = null;
  #picture = h("div", {});
  #select = h("select", { onchange: () => this.state.select(this.#select.value || null) });

  parts = /** @type {const} */ (["selection"]);

  get #views() {
    return (this.result?.residuals ?? []).filter((view) => (view.points_px ?? []).length > 0);
  }

  build() {
    const views = this.#views;
    this.#select.append(h("option", { value: "" }, t("camera.all_views", { views: views.length })),
      ...views.map((view) => h("option", { value: view.capture }, `${view.capture} · ${fixed(view.rms_px ?? 0, 3)} px${view.used ? "" : ` · ${t("captures.rejected")}`}`)));
    this.append(h("p", { class: "soft small" }, t("camera.arrows_what", { times: this.result ? timesLonger(this.result) : 1 })),
      field("camera-view", t("view.label"), this.#select), this.#picture);
  }

  update() {
    const { result } = this;
    if (!result) return;
    const views = this.#views;
    const one = views.find(({ capture }) => capture === this.state.selected);
    this.#select.value = one?.capture ?? "";
    const label = one ? t("camera.view_label", { capture: one.capture, corners: one.corners ?? 0, rms: fixed(one.rms_px ?? 0, 3) }) : t("camera.all_views", { views: views.length });
    const [width = 1, height = 1] = result.image_size.map(Number);
    this.#picture.replaceChildren(s("svg", { class: "arrows", viewBox: `-0.5 -0.5 ${width} ${height}`, role: "img", "aria-label": label },
      ...arrowsOn(one ? [one] : views.filter(({ used }) => used), Math.max(width, height), timesLonger(result))));
  }
}

customElements.define("sc-camera-residuals", CameraResidualsElement);

export const elements = {
  blocks: {
    /** @param {Block} _ @param {Context} context */
    "camera-residuals": (_, { state, stage }) => make(CameraResidualsElement, { state, result: /** @type {CameraResult} */ (/** @type {unknown} */ (state.results[stage])), className: "arrows-block" }),
  },
};
