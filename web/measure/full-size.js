// A capture at the size of the window: its profile with the arc and what lies along it, or its frame with what was found.

import "../texts/later.js";
import { h, make, s } from "../dom.js";
import { small } from "../format.js";
import { t } from "../texts.js";
import { arrowsOn, timesLonger } from "../result/arrows.js";
import { closeButton, showDialog } from "../components/dialog.js";
import { framePlot } from "./frame-plot.js";
import { PlotElement } from "../result/plot.js";
import { profilePlot } from "./profile-plot.js";

/** @import {CameraResult, CaptureOut, Measured} from "../state/model.js" */
/** @import {SessionState} from "../state/session.js" */

const SIZE = { width: 1000, height: 520 };

/** @param {CaptureOut} capture @param {SessionState} state */
export function fullSize(capture, state) {
  const { measured, id } = capture;
  showDialog(h("dialog", { class: "full-size", "aria-labelledby": "full-title" }, h("div", { class: "body" },
    h("div", { class: "row spread" }, h("h2", { id: "full-title" }, id), closeButton(t("close"), { autofocus: true })),
    ...(measured.image_size ? frameWithArrows(capture, state) : [profilePlot(measured, SIZE)]),
    along(measured))));
}

/** The frame with what was found in it, and with the camera's residuals once that is solved. @param {CaptureOut} capture @param {SessionState} state */
function frameWithArrows(capture, state) {
  const plot = framePlot(capture, state.id);
  const result = /** @type {CameraResult | undefined} */ (/** @type {unknown} */ (Object.values(state.results).find((one) => "reprojection_rms_px" in one)));
  const view = result?.residuals.find((one) => one.capture === capture.id && (one.points_px ?? []).length > 0);
  if (!result || !view) return [plot];
  const times = timesLonger(result);
  const [width = 1, height = 1] = result.image_size.map(Number);
  plot.append(s("g", { class: "arrows" }, ...arrowsOn([view], Math.max(width, height), times)));
  return [plot, h("p", { class: "soft small" }, t("camera.arrows_what", { times }))];
}

/** How far each point lies off the arc, along it. @param {Measured} measured */
function along({ center_mm: center, radius_mm: radius, preview = [], preview_on_sphere: on, image_size }) {
  if (image_size || !center || !radius || center.length !== 2 && preview[0]?.length !== 2) return null;
  const [cx, cz] = [center[0] ?? 0, center.at(-1) ?? 0];
  const points = (preview ?? []).flatMap((row, index) => {
    const [x, z] = [(row[0] ?? 0) - cx, (row.at(-1) ?? 0) - cz];
    return on?.[index] ? [{ angle: (Math.atan2(x, -z) * 180) / Math.PI, off: (Math.hypot(x, z) - radius) * 1000 }] : [];
  }).sort((a, b) => a.angle - b.angle);
  if (points.length < 3) return null;
  const rms = Math.sqrt(points.reduce((sum, { off }) => sum + off * off, 0) / points.length) / 1000;
  return h("figure", {}, make(PlotElement, { block: {
    kind: "plot", shape: "line", caption: t("full.along", { rms: small(rms) }), x: { label: t("full.angle"), unit: "°" }, y: { label: t("full.off"), unit: "µm", low: Math.min(...points.map(({ off }) => off)) },
    series: [{ x: points.map(({ angle }) => angle), y: points.map(({ off }) => off) }],
  } }), h("figcaption", { class: "soft small" }, t("full.along", { rms: small(rms) })));
}
