// A raw frame with what was found in it: the board's corners or the stripe.

import { api } from "../state/api.js";
import { s } from "../dom.js";
import { t } from "../texts.js";

/** @import {CaptureOut} from "../state/model.js" */

/**
 * What was found in a frame without the frame itself: for lists, which should not load a picture a row.
 * @param {CaptureOut} capture
 */
export function pointsPlot({ measured }) {
  const [width, height] = (measured.image_size ?? [1, 1]).map(Number);
  return s(
    "svg", { class: "frame-plot", viewBox: `-0.5 -0.5 ${width} ${height}` },
    s("path", { class: "found", "stroke-width": Math.max(width ?? 1, height ?? 1) / 24, d: (measured.preview ?? []).map(([x, y]) => `M${x} ${y}h0`).join("") }),
  );
}

/**
 * @param {CaptureOut} capture
 * @param {string} sessionId
 */
export function framePlot({ id, step, files, measured }, sessionId) {
  const [width, height] = (measured.image_size ?? [1, 1]).map(Number);
  // Browsers draw no TIFF; the points then stand alone.
  const name = files?.at(-1);
  const size = Math.max(width ?? 1, height ?? 1) / 80;
  const label = t(step === "laser-plane" ? "frame_plot.stripe" : "frame_plot.board", { capture: id, points: measured.points ?? 0 });
  return s(
    "svg", { class: "frame-plot", viewBox: `-0.5 -0.5 ${width} ${height}`, role: "img", "aria-label": label },
    name && !/\.tiff?$/i.test(name) && s("image", { href: api.fileAddress(sessionId, id, name), x: -0.5, y: -0.5, width, height }),
    s("path", { class: "found", "stroke-width": size, d: (measured.preview ?? []).map(([x, y]) => `M${x} ${y}h0`).join("") }),
  );
}
