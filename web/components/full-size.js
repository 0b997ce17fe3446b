// A capture at the size of the window: its profile with the arc and what lies along it, or its frame with what was found.

import { h, make } from "../dom.js";
import { small } from "../format.js";
import { t } from "../texts.js";
import { framePlot } from "./frame-plot.js";
import { PlotElement } from "./plot.js";
import { profilePlot } from "./profile-plot.js";

/** @import {CaptureOut, Measured} from "../state/model.js" */

const SIZE = { width: 1000, height: 520 };

/** @param {CaptureOut} capture @param {string} sessionId */
export function fullSize(capture, sessionId) {
  const { measured, id } = capture;
  const dialog = h("dialog", { class: "full-size", "aria-labelledby": "full-title" });
  dialog.append(h("div", { class: "body" },
    h("div", { class: "row spread" }, h("h2", { id: "full-title" }, id), h("button", { type: "button", autofocus: true, onclick: () => dialog.close() }, t("close"))),
    measured.image_size ? framePlot(capture, sessionId) : profilePlot(measured, SIZE),
    along(measured)));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
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
