// A capture at the size of a stamp: what was seen in it, without the file itself.

import { pointsPlot } from "./frame-plot.js";
import { profilePlot } from "./profile-plot.js";

/** @import {CaptureOut} from "../state/model.js" */

/** @param {CaptureOut} capture */
export function thumbnail(capture) {
  const plot = capture.measured.image_size ? pointsPlot(capture) : profilePlot(capture.measured, { width: 48, height: 28, scale: false, most: 60 });
  plot.removeAttribute("role");
  plot.removeAttribute("aria-label");
  plot.setAttribute("aria-hidden", "true");
  return plot;
}
