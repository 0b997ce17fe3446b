"""What the captures of the sphere on the table tell of the table, and what they say beside those of the still sphere."""

from calib_core.findings.code import Code

AXIS_TILT_OPEN = Code(
    "axis-tilt-undetermined",
    "error",
    text="Not determined: the axis may lean towards {axes}.",
    to_do="Capture the sphere all around, well off the axis and at two heights.",
    meaning="The captures leave the direction of the table's axis open.",
    decided="A tilt's standard deviation is above 0.5°.",
    usual_causes="Few angles, a sphere near the axis, one height.",
    fixed=True,
)

AXIS_MIRRORED = Code(
    "axis-mirrored",
    "error",
    text="Not determined: the axis, mirrored at the scanner's plane of light, fits the captures as well; it leans by "
    "{lean_deg:.1f}° from the stated one, and spheres on it lie up to {apart_mm:.1f} mm elsewhere.",
    to_do={
        "base": "Tell of one capture of each mounting on which side of the plane of light the sphere's centre is (side: 1 "
        "or −1 along the scanner's y), or in which sense the table's angles count (turntable.direction).",
        "axis": "Tell of one capture of each mounting on which side of the plane of light the sphere's centre is (side: 1 "
        "or −1 along the scanner's y), or in which sense the axis's readings count (direction in axes).",
        "scanner": "Tell of one capture of each mounting on which side of the plane of light the sphere's centre is "
        "(side: 1 or −1 along the scanner's y).",
        "side": "Tell of one capture of each mounting on which side of the plane of light the sphere's centre is "
        "(side: 1 or −1 along the scanner's y).",
    },
    by_to_do="known_in",
    meaning="A scanner that stands still before an axis sees the same profiles of the mirrored axis and spheres. A "
    "part that is merged by the mirrored answer is the part's mirror image.",
    decided="Only profiles of scanners that stand still show the axis, a mounting has no capture whose side is told, the mirrored "
    "answer has a chance of 1 % or more, and both lie more than 0.5° or 3 mm apart.",
    usual_causes="A scanner that stands still before a turntable.",
    fixed=True,
)

AXIS_PLACE_OPEN = Code(
    "axis-place-undetermined",
    "error",
    text="Not determined: the axis may lie further along {axes}.",
    to_do="Capture the sphere all around, well off the axis and at two heights.",
    meaning="The captures leave the place of the table's axis open.",
    decided="A shift's standard deviation is above 3 mm.",
    usual_causes="Few angles, a short arc of the circle.",
    fixed=True,
)

_REASON = {
    "mount": "the sphere appears {distance_mm:.2f} mm (along the axis {axial_mm:+.2f}, away from it {radial_mm:+.2f}, around it "
    "{around_deg:+.3f}°) from where the other captures expect it, {times:.0f} times the expected scatter; it fits the mounting "
    "'{mount}': tell that mounting.",
    "angle": "the sphere appears {distance_mm:.2f} mm (along the axis {axial_mm:+.2f}, away from it {radial_mm:+.2f}, around it "
    "{around_deg:+.3f}°) from where the other captures expect it, {times:.0f} times the expected scatter: check its table angle, its "
    "pose and its mounting, and take it again.",
}

MANY_CONTRADICT = Code(
    "many-table-captures-contradict",
    "error",
    text="{rejected} of {count} captures contradict the others ({names}).",
    to_do="Check table angles, mountings and poses, then repeat these.",
    meaning="So many captures were rejected that it is not known which of them are right.",
    decided="More than a third of the captures lie too far from where the others see the sphere.",
    usual_causes="Wrong table angles, a sphere that was mounted anew, poses that belong to other captures.",
    reason=_REASON,
    by="likely",
    fixed=True,
)

CAPTURES_CONTRADICT = Code(
    "table-captures-contradict",
    "warning",
    text="Left out for contradicting the others: {names}; see why.",
    meaning="These captures see the sphere elsewhere on the table than all others do. The answer rests on the others.",
    decided="Their squared Mahalanobis distance from what the others expect is beyond the limit of rejection.",
    usual_causes="A wrong angle or mounting, a sphere that was touched.",
    reason=_REASON,
    by="likely",
)

ANGLES_DO_NOT_FIT = Code(
    "table-angles-do-not-fit",
    "error",
    text={
        "one": "Table angles and scans do not fit together: the sphere is {scatter_mm:.1f} mm off its circle.",
        "several": "Readings of axes and scans do not fit together, those of {axis} least: spheres are {scatter_mm:.1f} mm off "
        "their ways.",
    },
    by="of",
    to_do="Check the angles, their unit, and that every capture has its own.",
    meaning="No axis brings the captures to a circle.",
    decided="The used captures lie more than 5 mm off their circles (RMS), or angles read otherwise are a million times "
    "likelier; in the whole chain also by the still sphere's tool alone, unless three of its sigmas explain it.",
    usual_causes="Angles in another unit, angles of other captures.",
    fixed=True,
)

TOOL_MOVED = Code(
    "tool-seen-elsewhere-on-table",
    "warning",
    text="The captures on the table see the scanner {shift_mm:.2f} mm and {turn_deg:.2f}° from where those of the still sphere "
    "do, beyond chance.",
    to_do="Check that the scanner sits firmly on the flange and that the sphere is the same, then take both kinds of "
    "captures again.",
    meaning="Both kinds of captures tell the tool, and they do not agree.",
    decided="Chance gives such a difference in fewer than three of a thousand cells.",
    usual_causes="A scanner that was moved between them, another sphere.",
)

REMOUNTED = Code(
    "sphere-remounted",
    "warning",
    text="{captures} agree on another place of the sphere on the table (x {x_mm:.1f}, y {y_mm:.1f}, z {z_mm:.1f} mm).",
    to_do="If it was mounted anew, give these captures a mounting of their own.",
    meaning="The rejected captures agree with each other.",
    decided="Three rejected captures or more lie within 2 mm of one place on the table.",
    usual_causes="A sphere that was mounted anew, without a new name.",
)

_MOVED_BY_CHANCE = "It makes all captures likelier by a factor that chance gives in about one of 400 tables that stand still, over all moves that are tried."

TABLE_PUSHED = Code(
    "table-pushed",
    "warning",
    text="The table stands {shift_mm:.2f} mm elsewhere from {since} on.",
    to_do="Fix it to the floor, then take all captures of the table again.",
    meaning="The captures before and after see the axis at two places. The stated axis is a mean of both.",
    decided=_MOVED_BY_CHANCE,
    usual_causes="A table that was pushed while the sphere was mounted anew, a robot that was moved.",
)

TABLE_CREEPS = Code(
    "table-creeps",
    "warning",
    text="The table moved by {shift_mm:.2f} mm, little by little, while its captures were taken.",
    to_do="Fix it to the floor and let it warm up, then take all captures of the table again.",
    meaning="The axis is elsewhere at the last capture than at the first. The stated axis is a mean.",
    decided=_MOVED_BY_CHANCE,
    usual_causes="A table on rollers or on soft ground, a frame or robot that warms up.",
)

SPHERE_RESEATED = Code(
    "sphere-reseated",
    "warning",
    text="The sphere stands {shift_mm:.2f} mm elsewhere on the table from {since} on.",
    to_do="If it was touched, give the captures from there on a mounting of their own; otherwise take them again.",
    meaning="Within one mounting the captures see the sphere at two places on the table.",
    decided=_MOVED_BY_CHANCE,
    usual_causes="A sphere that was taken off its stem and put back, or touched.",
)

CLAMP_GIVES = Code(
    "clamp-gives",
    "warning",
    text="The sphere moved by {shift_mm:.2f} mm on the table, little by little, between {since} and {until}.",
    to_do="Clamp it firmly, and take these captures again.",
    meaning="Within one mounting the sphere is elsewhere on the table at the last capture than at the first.",
    decided=_MOVED_BY_CHANCE,
    usual_causes="A magnetic foot that slides, a clamp that gives.",
)

TABLE_SCATTER_BEYOND_TOLD = Code(
    "table-scatter-beyond-told",
    "warning",
    text={
        "enlarged": "The captures scatter {times:.1f} times more than the given sigmas explain (wobble, play or a robot less "
        "exact than stated); the stated uncertainty is enlarged by that.",
        "held": "The captures scatter by {scatter_mm:.2f} mm where the robot's sigma says {told_mm:.2f} mm (wobble, play or a "
        "robot less exact than stated); the stated uncertainty holds it.",
    },
    by="handled",
    meaning="The captures disagree by more than the sigmas that were given allow.",
    decided="χ² of the captures is beyond what chance gives, or their scatter is 1.5 times what was told and what the arm "
    "explains.",
    usual_causes="A table that wobbles or has play, an arm that is less true than stated.",
)

ANGLES_NOT_READ = Code(
    "table-angles-not-read",
    "warning",
    text="The table's angles were not read: the axis rests on the shape of the circles alone, in direction weakest towards "
    "{weakest} (±{tilt_deg:.3f}°), in place known to {place_mm:.2f} mm. The sense of turning, angle zero and the encoder stay "
    "unknown.",
    to_do={
        "told": "",
        "open": "Give turntable.direction before scanning by table angles.",
    },
    by="direction",
    meaning="Without angles, the captures tell the axis by the circles that they lie on.",
    decided="The cell says that the angles are unknown.",
    usual_causes="A table without an encoder.",
)

ONE_HEIGHT = Code(
    "one-height",
    "warning",
    text="One height only: the axis's direction rests on the plane of one circle, weakest towards {weakest} "
    "(±{tilt_deg:.3f}°).",
    to_do={
        "tool0": "Mount the sphere 100 mm or more higher and capture it all around again.",
        "base": "Mount the sphere as high, then as low, as the scanner's light still meets it all around, and capture it "
        "at both; a larger sphere reaches farther.",
    },
    by_to_do="scanners",
    meaning="A circle tells its axis's direction by its plane alone; two heights tell it by their distance.",
    decided="All mountings lie within 20 mm along the axis, and no axis under the table leaned it; to a scanner that stands "
    "still the axis is known to no better than 0.1°.",
    usual_causes="One mounting.",
)

_WIDENS = ("table-pushed", "table-creeps", "sphere-reseated", "clamp-gives", "axis-wobbles", "encoder-eccentric")

AXIS_WEAK = Code(
    "axis-direction-weak",
    "warning",
    text="The axis's direction is weakly determined, weakest towards {weakest} (±{tilt_deg:.3f}°).",
    to_do="Add angles all around, and heights.",
    meaning="The axis's direction is known less well than usual. The stated uncertainty holds it.",
    decided="Its standard deviation is above 0.1°, to a scanner that stands still as that sees the axis.",
    usual_causes="Few angles, heights that are near to each other.",
    behind=_WIDENS,
)

AXIS_WOBBLES = Code(
    "axis-wobbles",
    "warning",
    text={
        "2": "The table's axis seems to wobble by {size_deg:.3f}° twice a turn: the stated axis is a mean, and a scan at one "
        "angle may be off by as much.",
        "3": "The table's axis seems to wobble by {size_deg:.3f}° three times a turn: the stated axis is a mean, and a scan at "
        "one angle may be off by as much.",
        "2 of several": "The axis {axis} seems to wobble by {size_deg:.3f}° twice a turn: where it is stated is a mean, and a "
        "scan at one of its angles may be off by as much.",
        "3 of several": "The axis {axis} seems to wobble by {size_deg:.3f}° three times a turn: where it is stated is a mean, "
        "and a scan at one of its angles may be off by as much.",
    },
    to_do="Check the bearing, or capture at more angles.",
    by="times",
    meaning="The axis leans with the table's angle, in a pattern that a bearing makes.",
    decided="The pattern makes all captures likelier by a factor that chance gives in fewer than 1 of 2,000 tables, and leans "
    "at least 0.2 mrad.",
    usual_causes="A worn bearing, a table that is not fixed firmly.",
)

ENCODER_ECCENTRIC = Code(
    "encoder-eccentric",
    "warning",
    text={
        "one": "The table's angle seems to err by {size_deg:.3f}° once a turn, as of an eccentric encoder or an axis that "
        "wobbles: scans at different angles are off by as much.",
        "several": "The angle of the axis {axis} seems to err by {size_deg:.3f}° once a turn, as of an eccentric encoder or an "
        "axis that wobbles: scans at different angles of it are off by as much.",
    },
    by="of",
    to_do="Check the encoder's mounting and the bearing.",
    meaning="The angle errs with itself, once a turn.",
    decided="The pattern makes all captures likelier by a factor that chance gives in fewer than 1 of 2,000 tables, and is at "
    "least 0.02°.",
    usual_causes="An encoder that is mounted off its centre.",
)

ENCODER_SCALE = Code(
    "encoder-scale",
    "warning",
    text={
        "one": "The table turns by {error_percent:+.3f} ± {uncertainty_percent:.3f} % more than its angles say.",
        "rotary": "The axis {axis} turns by {error_percent:+.3f} ± {uncertainty_percent:.3f} % more than its angles say.",
        "linear": "The axis {axis} travels {error_percent:+.3f} ± {uncertainty_percent:.3f} % farther than its readings say.",
    },
    to_do={
        "applied": "The answer accounts for it; check the encoder and the gear.",
        "left": "The answer does not account for it, as encoder is 'exact'; check the encoder and the gear.",
    },
    by="of",
    by_to_do="handled",
    meaning="A full turn of the angles is not a full turn of the table.",
    decided="The factor differs from one beyond chance.",
    usual_causes="A gear ratio that is slightly wrong.",
)

ANGLES_SCATTER = Code(
    "table-angles-scatter",
    "warning",
    text="The table's angles scatter by {scatter_deg:.3f}°.",
    to_do="Check the encoder and the table's brake.",
    meaning="The angles are less exact than those of tables in order.",
    decided="Their estimated standard deviation is above 0.05°.",
    usual_causes="A loose brake, a coarse encoder, play.",
)

PLAY_NOT_CHECKED = Code(
    "play-not-checked",
    "note",
    text="Not checked: play of the table that is always taken up from one side.",
    to_do="Approach angles from that side when scanning too, or capture one from the other.",
    meaning="Play that is always taken up from one side shifts angle zero, and every capture agrees.",
    decided="No angle was captured again after the table had been elsewhere.",
)

TABLE_PLAY = Code(
    "table-play",
    "warning",
    text="{captures} are one angle of the table, captured twice, but see the sphere {apart_deg:.3f}° apart: the table has "
    "play, or the sphere moved.",
    to_do="Approach every angle from the same side, in scans too.",
    meaning="An angle that was reached twice shows the sphere at two places.",
    decided="They are further apart than three standard deviations of two captures, and than 0.01°.",
    usual_causes="A worn gear, a sphere that was touched.",
)

ANGLES_REPEAT = Code(
    "table-angles-repeat",
    "note",
    text="Angles captured again after the table had been elsewhere differ by {apart_deg:.3f}° at most ({captures}): where they "
    "were approached from the other side, the table's play is no larger.",
    meaning="Angles that were reached twice check the table's play.",
    decided="They are no further apart than chance allows.",
)

TCP_FAILED = Code(
    "tcp-failed-before",
    "warning",
    text="The tcp stage's own verdict is fail: fix that first.",
    meaning="The table is solved by a tool that is not to be used.",
    decided="The tcp stage has a finding of severity error.",
    usual_causes="See the findings of the tcp stage.",
)

TCP_DOUBTFUL = Code(
    "tcp-doubtful-before",
    "warning",
    text="The TCP that this rests on is to be used with care: see its warnings first.",
    meaning="The table is solved by a tool that is doubted.",
    decided="The tcp stage has a finding of severity warning.",
    usual_causes="See the findings of the tcp stage.",
)

BY_TOOL_ALONE = Code(
    "optics-by-tool-alone",
    "note",
    text="Camera and plane of light are counted here through the tool alone. What they do to the captures of the table is "
    "counted by the whole chain: it knows the axis's place better and says more rightly how it may lean.",
    meaning="How camera and plane of light err enters the table through the tool, not through the captures themselves.",
    decided="The captures are frames, and camera and plane of light have uncertainties.",
)

CHAIN_TOOL_DIFFERS = Code(
    "chain-tool-differs",
    "warning",
    text="The tcp stage alone gives a tool that differs by {shift_mm:.3f} mm and {turn_deg:.3f}°, more than its uncertainty "
    "allows: the captures of the table contradict those of the still sphere.",
    to_do="Check that sphere, scanner mounting and robot are the same in both.",
    meaning="With the captures of the table, the tool is elsewhere than without them.",
    decided="Chance gives such a difference in one cell of a thousand.",
    usual_causes="A scanner that was moved between them, another sphere.",
    behind=("tool-seen-elsewhere-on-table",),
)

CHAIN_TABLE_DIFFERS = Code(
    "chain-table-differs",
    "warning",
    text="The turntable stage alone gives a frame that differs by {shift_mm:.3f} mm and {turn_deg:.3f}°, more than its "
    "uncertainty allows.",
    to_do="Check the table's wobble, its angles, and that the scanner sits firmly.",
    meaning="With the captures of the still sphere, the table is elsewhere than by the tool held.",
    decided="Chance gives such a difference in one cell of a thousand.",
    usual_causes="A table that wobbles, a scanner that was moved.",
    behind=("tool-seen-elsewhere-on-table", "table-pushed", "table-creeps"),
)
