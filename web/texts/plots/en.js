// English: plots, the keys and the glossary.

export const texts = Object.freeze({
  "plot.keys": "Arrow keys move between the points, Enter selects one, + and − zoom, 0 shows everything.",
  "plot.shown": "Figures shown",
  "plot.in_sigma": "In standard deviations",
  "plot.in_mm": "Distance in mm",
  "plot.caption_mm": "How far each capture's sphere lies from where all the others expect it, in millimetres. Crosses are captures that are not used.",
  "plot.caption_parts": "The same distances in parts: {parts}, in millimetres. Crosses are captures that are not used.",
  "plot.parts_base": "x in base, y in base, z in base",
  "plot.parts_table": "across the axis, around the axis, along the axis",
  "plot.zoom_in": "Zoom in",
  "plot.zoom_out": "Zoom out",
  "plot.zoom_all": "Show everything",
  "plot.rejected": "rejected: {reason}",
  "keys.capture": "Take the next capture of the simulated cell",
  "keys.redo": "Redo",
  "keys.step": "Open a step",
  "keys.view": "Show measuring or the result",
  "keys.dots": "In a plot: go to the next point",
  "keys.pick": "In a plot: select the capture, everywhere",
  "keys.exclude": "In a plot: exclude the capture, or include it again",
  "keys.keys": "Show these keys",
});
