// A picture: one of the page's drawings, or a file of a capture.

import { DrawingElement } from "../measure/drawing.js";
import { h, make } from "../dom.js";
import { api } from "../state/api.js";
import { said } from "../texts.js";

/** @import {PictureBlock} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

/** @param {PictureBlock} block @param {SessionState} state */
export function picture({ drawing, capture, file, alt }, state) {
  const shown = capture && file && !/\.tiff?$/i.test(file); // browsers draw no TIFF
  const image = shown ? h("img", { src: api.fileAddress(state.id, capture, file), alt: "", loading: "lazy" }) : !capture && make(DrawingElement, { name: drawing ?? "cell" });
  return h("figure", { class: "evidence-picture" }, image, h("figcaption", { class: "soft small" }, said(alt)));
}
