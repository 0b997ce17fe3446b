// English. Results of every step, and those of the tool.

export const result = {
  "result.none": "Not solved yet.",
  "result.stale_words": "Inputs changed since this was solved. Solve again.",
  "result.verdict": "Verdict",
  "result.report": "Report",
  "result.review": "Review",
  "result.compare": "Compare",
  "result.links": "More about this result",

  "verdict.pass": "accepted",
  "verdict.warn": "usable",
  "verdict.fail": "failed",
  "verdict.stale": "out of date",

  "frame.what": "{units}. ± is k = 2.",
  "frame.copy": "Copy",

  "evidence.title": "Evidence",
  "evidence.captures": "Captures used",
  "evidence.used_of": "{used} of {all}",

  "compare.what": "Quantity",
  "compare.difference": "Difference",

  "figure.surface_rms_mm": "Points off the sphere",
  "figure.leave_one_out_surface_rms_mm": "Left-out captures",
  "figure.center_scatter_rms_mm": "Centre scatter",
  "figure.reprojection_rms_px": "Reprojection, RMS",
  "figure.plane_rms_mm": "Stripes off the plane",


  "history.title": "History",
  "history.wait": "Loading …",
  "history.when": "Solved",
  "history.software": "Software",
  "history.beside": "Compare with latest",
  "history.latest": "latest",
  "history.only": "the only one",

  "evidence.unknown": "This page cannot show a block of the kind {kind}.",
  "frame.matrix": "Matrix {name}",
  "frame.copy_matrix": "Copy the matrix",
  "answer.more": "{count} more",
  "answer.notes": "Notes ({count})",
  "answer.next": "Next:",
  "truth.title": "Compared with the truth",
  "truth.off": "Off by {error} at the workpiece and {angle}°. Stated: ±{stated}. The error is {share} of that.",
  "truth.within": "as stated",
  "truth.beyond": "more than stated",
  "settings.title": "Solve with other settings",
  "settings.go": "Solve again",
  "plot.keys": "Arrow keys move between the points, Enter selects one.",
  "plot.rejected": "rejected: {reason}",
  "plot.out": "rejected",

  "camera.view": "View",
  "camera.all_views": "All {views} views",
  "camera.view_label": "Residuals of view {capture}: {corners} corners, RMS {rms} px",
  "camera.arrows_what": "Seen minus predicted, drawn {times} times as long. Arrows in one direction in one region mean that the lens model does not fit there.",
  "frame_plot.board": "Frame of capture {capture}: {points} board corners marked",
  "frame_plot.stripe": "Frame of capture {capture}: {points} stripe points marked",
  "form.need_number": "Enter a number in the allowed range.",
  "remedy.convention": "Read poses as {convention}",
  "result.export": "Export …",
  "answer.wanted": "wanted {limit}",
  "result.no_evidence": "This result was stored without its evidence. Solve again to see it.",
};
