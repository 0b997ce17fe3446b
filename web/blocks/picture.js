// A picture: one of the page's drawings, or a file of a capture.

import { DrawingElement } from "../measure/drawing.js";
import { h, make } from "../dom.js";
import { api } from "../state/api.js";

/** @import {PictureBlock} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/** @param {PictureBlock} block @param {SessionState} state */
export function picture({ drawing, capture, file, alt }, state) {
  const image = capture && file ? h("img", { src: api.fileAddress(state.id, capture, file), alt, loading: "lazy" }) : make(DrawingElement, { name: drawing ?? "cell" });
  return h("figure", { class: "evidence-picture" }, image, !capture && h("figcaption", { class: "soft small" }, alt));
}
