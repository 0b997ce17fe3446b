"""What the captures of the still sphere tell of the tool, and of arm and scanner."""

from calib_core.findings.code import Code

POSES_DO_NOT_FIT = Code(
    "poses-do-not-fit",
    "error",
    text="Poses and scans do not fit together: the sphere's centre scatters by {scatter_mm:.1f} mm.",
    to_do="Check the pose convention, the units, and that every capture has its own pose.",
    meaning="No tool brings the captures of the sphere to one place. Any answer would be wrong.",
    decided="The sphere's centres scatter by more than 5 mm about their mean, or the poses' estimated standard "
    "deviation is above 2.5 mm. Arms that are only untrue stay below 1 mm.",
    usual_causes="Another pose convention or unit, poses of a tool instead of the flange, captures with the pose of "
    "another one.",
    fixed=True,
)

ROTATION_OPEN = Code(
    "tool-rotation-undetermined",
    "error",
    text="Not determined: the scanner's rotation about laser {axes}.",
    to_do="Move the flange so that the sphere is seen farther aside and at another distance, without turning it.",
    meaning="The captures leave a rotation of the scanner on the flange open: the answer is one of many.",
    decided="A rotation's standard deviation is above 2°.",
    usual_causes="The sphere always appears at one place of the scanner's field.",
    fixed=True,
)

POSITION_WITHOUT_TURNS = Code(
    "tool-position-without-turns",
    "warning",
    text="The scanner's position is not determined along {axes}: the machine did not turn about an axis "
    "across it.",
    to_do="Tilt the flange about {across} and capture again, or measure the position.",
    meaning="A machine of few axes, as a gantry, moves scanner and ball alike when the scanner is mounted elsewhere: "
    "nothing that it sees tells where. All else is determined and given.",
    decided="All poses have one orientation, or turn about one axis, to 0.06°.",
    usual_causes="A gantry, a Cartesian machine or a SCARA; or the captures with tilts are still missing.",
)

ROTATION_ABOUT_TRAVEL = Code(
    "tool-rotation-about-travel",
    "warning",
    text="The scanner's rotation about laser {axis} is not determined: the machine moved along one line only.",
    to_do="Move the flange across that line by 50 mm or more and capture again, or measure how the scanner is turned "
    "about it.",
    meaning="A machine of one linear axis sees the same when scanner, ball and table are turned together about its "
    "travel. All else is determined and given.",
    decided="All poses have one orientation, to 0.06°, and lie on one line, to 0.1 mm.",
    usual_causes="A scanner on one linear axis; or the captures beside its line are still missing.",
)

PLACE_NOT_NEEDED = Code(
    "tool-place-not-needed",
    "note",
    text={
        "position": "The scanner's position on the flange stays open along {axes}, as the machine does not turn about an axis "
        "across it; where scanner and table are used together it is not needed.",
        "rotation": "The scanner's rotation about laser {axes} stays open, as the machine moves along one line; where scanner "
        "and table are used together it is not needed.",
    },
    by="what",
    meaning="Scanner, sphere and table, moved together, look the same to a machine of few axes. Scans on the table are "
    "merged rightly all the same; what is open has no number.",
    decided="As for tool-position-without-turns and tool-rotation-about-travel, in a session with captures on a table.",
    usual_causes="A gantry, a SCARA or a linear axis before a turntable.",
)

TOOL_MIRRORED = Code(
    "tool-mirrored",
    "error",
    text="Not determined: scanner and sphere, mirrored at the plane of light, fit the captures as well.",
    to_do="Tell of one capture on which side of the plane of light the sphere's centre is (side: 1 or −1 along the "
    "scanner's y).",
    meaning="A machine that moves along one line sees the same profiles of the mirrored cell. A part that is merged "
    "by the mirrored answer is the part's mirror image.",
    decided="All poses lie on one line, all captures are profiles, and no capture's side is told.",
    usual_causes="A scanner on one linear axis.",
    fixed=True,
)

POSITION_OPEN = Code(
    "tool-position-undetermined",
    "error",
    text="Not determined: the scanner's position along {axes} of what carries it: no sufficient rotation about an "
    "axis across it yet.",
    to_do="Tilt the flange about {across} of that frame, one of them at least.",
    meaning="The captures leave a shift of the scanner on the flange open: the answer is one of many.",
    decided="A shift's standard deviation is above 5 mm.",
    usual_causes="The flange was turned about one axis alone, or not at all.",
    fixed=True,
)

ROTATION_WEAK = Code(
    "tool-rotation-weak",
    "warning",
    text="Weakly determined: the scanner's rotation about laser {axes}.",
    to_do="Move the flange so that the sphere is seen farther aside and at another distance, without turning it.",
    meaning="The captures fix a rotation of the scanner less well than others. The stated uncertainty holds it.",
    decided="A rotation's standard deviation is large, but below the limit of 2° beyond which it is undetermined.",
    usual_causes="Few captures, or a sphere that appears at nearly one place of the scanner's field.",
)

POSITION_WEAK = Code(
    "tool-position-weak",
    "warning",
    text="Weakly determined: the scanner's position along {axes} of what carries it: no sufficient rotation about "
    "an axis across it yet.",
    to_do="Tilt the flange about {across} of that frame, one of them at least.",
    meaning="The captures fix a shift of the scanner less well than others. The stated uncertainty holds it.",
    decided="A shift's standard deviation is large, but below the limit of 5 mm beyond which it is undetermined.",
    usual_causes="Small tilts, or tilts about nearly one axis.",
)

MANY_CONTRADICT = Code(
    "many-captures-contradict",
    "error",
    text="{rejected} of {count} captures contradict the others ({names}).",
    to_do="Check that the sphere stands firmly and that the poses belong to the captures, then repeat these.",
    meaning="So many captures were rejected that it is not known which of them are right.",
    decided="More than a third of the captures lie too far from where the others see the sphere.",
    usual_causes="A sphere that was moved, poses that belong to other captures, an arm that was still moving.",
    reason={
        "moved": "the sphere appears {distance_mm:.2f} mm (x {x_mm:+.2f}, y {y_mm:+.2f}, z {z_mm:+.2f} in base) from "
        "where the other captures see it, {times:.0f} times the expected scatter: the sphere was moved, or the pose is "
        "not this capture's. Check both and take it again.",
        "twin": "the sphere appears {distance_mm:.2f} mm (x {x_mm:+.2f}, y {y_mm:+.2f}, z {z_mm:+.2f} in base) from "
        "where the other captures see it, {times:.0f} times the expected scatter; its pose is that of {twin}. Enter the "
        "pose of this capture, or take it again.",
    },
    by="likely",
    behind=("poses-do-not-fit",),
    led_by=("moved-sphere", "changed-tool", "swapped-poses", "shifted-poses"),
    fixed=True,
)

CAPTURES_CONTRADICT = Code(
    "captures-contradict",
    "warning",
    text="Left out for contradicting the others: {names}; see why.",
    meaning="These captures see the sphere elsewhere than all others do. The answer rests on the others.",
    decided="Their squared Mahalanobis distance from what the others expect is beyond the limit of rejection.",
    usual_causes="A pose that belongs to another capture, a sphere or a scanner that was touched, an arm that moved.",
    reason=MANY_CONTRADICT.reason,
    by="likely",
    behind=("shifted-poses",),
)

SIDE_OPEN = Code(
    "sphere-side-open",
    "warning",
    text="Which side of the plane of light the sphere is on is hardly decided.",
    to_do="Add captures with the plane well off the sphere's middle, or tell each capture's side.",
    meaning="A profile shows a circle; the sphere's centre may lie on either side of the plane of light.",
    decided="The other choice of sides is less than 150 times less likely.",
    usual_causes="Profiles through the sphere's middle, few captures.",
    behind=("tool-rotation-undetermined", "tool-position-undetermined"),
)

FEW_CAPTURES = Code(
    "few-captures",
    "warning",
    text="Only {count} captures are used, {spare} measured values more than unknowns: errors can hide.",
    to_do="Add a few orientations.",
    meaning="The captures determine the answer, but hardly check it: the estimated scatter may be small by chance.",
    decided="Fewer than nine measured values more than unknowns.",
    usual_causes="A session that is not finished, or captures that were left out.",
)

TWO_STEPS_DIFFER = Code(
    "two-steps-differ",
    "warning",
    text="At the workpiece the joint answer and the paper's two steps differ by more than is stated "
    "({shift_mm:.2f} mm, {turn_deg:.2f}°): the pure translations may not have kept their orientation.",
    meaning="The paper's method rests on shifts of the flange without any turn. Where these turned, it is off.",
    decided="Chance gives such a difference in one session of a thousand (χ² with six degrees of freedom), and it "
    "is larger at the workpiece than the stated uncertainty (k = 2).",
    usual_causes="Shifts that turned the flange a little, errors of arm or scanner that move both answers otherwise.",
    behind=("tool-seen-elsewhere-on-table",),
)

SCATTER_BEYOND_TOLD = Code(
    "scatter-beyond-told",
    "warning",
    text={
        "enlarged": "The captures scatter {times:.1f} times more than the given sigmas explain: the stated uncertainty "
        "is enlarged accordingly.",
        "estimated": "The captures scatter {times:.1f} times more than the given sigmas explain: the robot's were "
        "estimated instead.",
    },
    to_do={"enlarged": "", "estimated": "Leave them out, or check the arm."},
    by="handled",
    meaning="The captures disagree by more than the sigmas that were given allow.",
    decided="χ² of the captures is beyond what chance gives with the given sigmas.",
    usual_causes="Sigmas that are too small, an arm that is less true than stated, a sphere that is not firm.",
)

POINT_NOISE_DIFFERS = Code(
    "point-noise-differs",
    "warning",
    text="The points scatter by {measured_mm:.3f} mm about their arcs, but {told_mm:.3f} mm was told for "
    "one point.",
    meaning="The noise of the points is not the one that was told.",
    decided="It differs from `scanner.point_sigma_mm` by more than a factor of two.",
    usual_causes="A sigma of another scanner or mode, an exposure that does not suit the sphere.",
)

POSES_SCATTER = Code(
    "poses-scatter",
    "warning",
    text="The poses scatter by {scatter_mm:.2f} mm: more than a sound arm.",
    to_do="Check its mastering, its tool and the sphere's stand.",
    meaning="The poses are less true than those of arms in order.",
    decided="The poses' estimated standard deviation is above 1 mm.",
    usual_causes="A lost mastering, a loose tool or sphere.",
)

SCANNER_BOW = Code(
    "scanner-bow",
    "warning",
    text="The scanner's z seems bent over its width: it hides in the TCP.",
    to_do="Check the scanner's own calibration.",
    meaning="A straight edge would look curved to this scanner.",
    decided="The bow differs from zero beyond chance.",
    usual_causes="A scanner whose own calibration is off.",
)

SCANNER_SCALE = Code(
    "scanner-scale-off",
    "warning",
    text="The scanner's {axis} scale seems wrong by {error_percent:+.1f} ± {uncertainty_percent:.1f} %.",
    to_do={
        "applied": "It is taken out of the points for the TCP; check the scanner's own calibration and the sphere's "
        "diameter.",
        "left": "The TCP is that of the files as they are (cell.scanner.errors: apply takes it out); check the "
        "scanner's own calibration and the sphere's diameter.",
    },
    by="handled",
    meaning="One of the scanner's two directions is stretched or squeezed.",
    decided="The factor differs from one beyond chance.",
    usual_causes="A scanner whose own calibration is off, a sphere of another diameter.",
)

SCANNER_SHEAR = Code(
    "scanner-shear",
    "warning",
    text="The scanner's x leans with z (shear) by {error_percent:+.1f} ± {uncertainty_percent:.1f} %.",
    to_do=SCANNER_SCALE.to_do,
    by="handled",
    meaning="The scanner's two directions are not at right angles.",
    decided="The shear differs from zero beyond chance.",
    usual_causes="A scanner whose own calibration is off.",
)

SPHERE_DIAMETER = Code(
    "sphere-diameter-told",
    "note",
    text="Sphere diameter {diameter_mm:g} ± {uncertainty_mm:.2g} mm (95 %), as told or, where only the diameter was "
    "told, as for its class (cell.sphere_class).",
    meaning="The diameter and its uncertainty, by which arcs tell the sphere's centre.",
    decided="Always told where points are used.",
)

COUNT_LESS = Code(
    "captures-count-less",
    "note",
    text="Counted less because they lie off: {weights}.",
    meaning="These captures lie off the others, but not so far that they are left out.",
    decided="Their weight is below one half.",
    usual_causes="A pose that errs a little more than others.",
)

_DRIFTED = {
    "scanner": "The scanner had not settled: it drifted by {drift_mm:.2f} ± {uncertainty_mm:.2f} mm.",
    "sphere": "The sphere, or the robot's base, had not settled: it drifted by {drift_mm:.2f} ± "
    "{uncertainty_mm:.2f} mm.",
    "scanner-or-sphere": "The scanner or the sphere had not settled: it drifted by {drift_mm:.2f} ± "
    "{uncertainty_mm:.2f} mm.",
}
_AFTER_DRIFT = {
    "first-captures": "Most of it was in the first {first} captures: take them again, or exclude them.",
    "first-minutes": "Most of it was in the first {minutes} minutes: take again what was captured until then, or "
    "exclude it: {captures}.",
    "all-captures": "It went on over {count} captures, to the end: let the scanner warm up, see that the sphere stands "
    "firmly, and take the captures again.",
    "all-minutes": "It went on over {minutes} minutes, to the end: let the scanner warm up, see that the sphere stands "
    "firmly, and take the captures again.",
}

SHEET_BENT = Code(
    "sheet-bent",
    "warning",
    text={
        "solved": "The scanner's sheet of light is bent: by {bend_mm:.2f} mm at {half_width_mm:.0f} mm from its middle. "
        "It is solved with the tool; table and merged scans count with it.",
        "allowed": "The scanner's sheet of light may be bent: by {bend_mm:.2f} mm at {half_width_mm:.0f} mm from its "
        "middle. Something else might look so; the tool's uncertainty allows for it.",
        "solved-of-one": "The sheet of light of the scanner '{scanner}' is bent: by {bend_mm:.2f} mm at "
        "{half_width_mm:.0f} mm from its middle. It is solved with the tool; table and merged scans count with it.",
        "allowed-of-one": "The sheet of light of the scanner '{scanner}' may be bent: by {bend_mm:.2f} mm at "
        "{half_width_mm:.0f} mm from its middle. Something else might look so; the tool's uncertainty allows for it.",
    },
    by="handled",
    to_do="Calibrate the scanner's plane of light again, or scan with the stripe's middle alone.",
    meaning="Points at the stripe's ends lie beside the plane that all points are taken to lie in. Scans are off by as much, "
    "unless it is solved.",
    decided="One unknown more, the points' distance from the plane by the square of x, makes all captures likelier by a "
    "factor that chance gives in one of 1,000 sessions. Where chance gives it in one of 1,000,000, it is solved.",
    usual_causes="A home-built scanner whose line laser is not a plane, a window in the way of the light.",
)

DRIFTED = Code(
    "drift-in-session",
    "warning",
    text=_DRIFTED,
    to_do=_AFTER_DRIFT,
    by="moved",
    by_to_do="course",
    meaning="While the captures were taken, the scanner or the sphere moved slowly.",
    decided="A drift that chance explains in fewer than one of 100,000 sessions, larger than the answer's uncertainty "
    "has room for.",
    usual_causes="A scanner that was just switched on, a cell that warms up, a stand that gives way.",
)

DRIFT_COVERED = Code(
    "drift-covered",
    "note",
    text={moved: f"{said} The stated uncertainty holds it." for moved, said in _DRIFTED.items()},
    by="moved",
    meaning="As `drift-in-session`, but the answer's uncertainty holds it.",
    decided="The drift is no larger than twice the tool's own uncertainty at the workpiece, and below 0.5 mm.",
    usual_causes="A scanner that was just switched on.",
)

BOARD_PITCH = Code(
    "board-pitch-doubtful",
    "warning",
    text={
        "open": "The frames' lengths rest on the board's pitch, {pitch_mm:g} mm: if it is wrong, arcs of the sphere "
        "come out too large or too small. Which pitch would be right cannot be told from these captures.",
        "told": "The frames' lengths rest on the board's pitch, {pitch_mm:g} mm: sphere and robot motions fit together "
        "at {factor:.3f} times these lengths, so the pitch looks like {likely_mm} mm, you said {pitch_mm:g} mm.",
    },
    to_do={"open": "Check cell.board.pitch_mm.", "told": "Check cell.board.pitch_mm and cell.sphere_diameter_mm."},
    by="likely",
    meaning="Lengths of frames come from the board. The sphere and the robot tell them too.",
    decided="With another pitch the sphere's centres lie less than half as far apart.",
    usual_causes="A board that was printed to another scale, a pitch that was typed wrongly.",
)
