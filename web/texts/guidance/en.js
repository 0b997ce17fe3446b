// English. What a cell will reach, the error budget at a point, planned poses.

export const texts = {
  "guidance.number": "Enter a number.",

  "plan.title": "Plan a cell", "plan.how": "What is reachable before anything is bought or mounted: with which sphere, in how many captures, and where to put it.",
  "plan.scanner": "Scanner", "plan.near_mm": "Field begins at, mm", "plan.far_mm": "Field ends at, mm", "plan.near_width_mm": "Width where it begins, mm", "plan.far_width_mm": "Width where it ends, mm",
  "plan.point_sigma_mm": "Noise of a point, mm", "plan.pitch_mm": "Between points, mm", "plan.mounting_mm": "From flange to scanner, mm",
  "plan.cell": "Arm, sphere and wanted uncertainty", "plan.arm": "Arm", "plan.arm_ordinary": "Ordinary", "plan.arm_calibrated": "With measured kinematics", "plan.arm_nominal": "Large, as delivered",
  "plan.sphere_class": "Sphere quality", "plan.sphere_certified": "With a certificate", "plan.sphere_bearing": "Bearing ball", "plan.sphere_coated": "Coated matt", "plan.sphere_turned": "Turned or printed",
  "plan.sphere_diameter_mm": "Sphere diameter, mm (empty: try common ones)", "plan.wanted_mm": "Wanted ± at the workpiece, mm",
  "plan.table": "With a turntable", "plan.table_radius_mm": "Workpiece radius about the axis, mm", "plan.table_height_mm": "Workpiece height, mm", "plan.table_angle_sigma_deg": "Standard deviation of the angle, °",
  "plan.go": "Plan", "plan.wait": "Planning …", "plan.seen": "Let the scanner see the sphere at {distance} mm, the stripe {offset} mm beside its middle.", "plan.limited": "More captures do not help against {by}.",
  "plan.sphere": "Sphere", "plan.captures": "Captures", "plan.then": "± then", "plan.off_axis": "Off the axis", "plan.heights": "Heights", "plan.angles": "Angles each",

  "budget.title": "Error budget", "budget.how": "How much each source contributes to a measured point. Pick the point: in the turntable's frame at angle zero or, without a table, where the scanner sees it.",
  "budget.axis": "{axis}, mm", "budget.go": "Show", "budget.one_scan": "{one} for one scan, {many} however many are averaged (k = 2, worst direction).",
  "budget.part": "Source", "budget.rms": "Standard deviation", "budget.worst": "Worst direction", "budget.kind": "Over scans", "budget.shared": "the same in every scan", "budget.averages": "averages out",
  "budget.part_tool": "Scanner on the flange (TCP)", "budget.part_scanner": "Scanner's own errors", "budget.part_table": "Turntable", "budget.part_arm": "Arm, own scatter", "budget.part_arm_alike": "Arm, alike where poses are alike (cancels in part)", "budget.part_angle": "Table's angle", "budget.part_points": "Noise of a point", "budget.part_camera": "Camera", "budget.part_plane": "Plane of light",
  "budget.within": "95 % of errors lie within ± {within} (x, y, z).", "budget.offset": "Known to lie off by {offset} (x, y, z), since errors of the scanner that were found stay in its files.",
  "budget.cancel": "These were found together: their errors take {amount} off each other.", "budget.add_up": "These were found together: their errors add {amount} to each other.", "budget.stale": "This answer is out of date: solve again.",
  "budget.height": "Height over the table", "budget.picture": "Uncertainty over the table, from {least} to {most}", "budget.pick": "Click to pick a point. Pale is {least}, full colour {most}.",

  "planned.title": "Planned poses", "planned.how": "Poses that together leave the least uncertainty at the workpiece, the most helpful one first.",
  "planned.step": "For", "planned.step_tcp": "the TCP", "planned.step_turntable": "the turntable", "planned.step_verify": "a verification",
  "planned.pose": "Flange in base ({convention})", "planned.brand": "Controller", "planned.save": "Save as program", "planned.saved": "{name} is saved.",
  "planned.safety": "Its positions are those of the flange. The program moves slowly, from well outside, and stops before each move until the operator starts it. Use manual mode.",

  "arm.unknown": "not known", "arm.urdf": "From a URDF …", "arm.taken": "{source}: {count} joints",
  "certificate.taken": "{name} of certificate {number} is taken.", "certificate.several": "Certificate {number} has several diameters; {name} is taken. Check that it is the right one.",
};
