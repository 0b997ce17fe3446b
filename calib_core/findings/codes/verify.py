"""What a verification notices: its decision, captures that do not count, captures that do not agree."""

from calib_core.findings.code import Code, Plural

_RULE = (
    "By the decision rule of ISO 14253-1 with a guard band of U (k = 2), fixed before measuring: pass up to the "
    "limit less U, conditional pass up to the limit, conditional fail up to the limit plus U, fail beyond."
)

VERIFY_FAIL = Code(
    "verify-fail",
    "error",
    text="{title}: {value_mm:.{digits}f} ± {uncertainty_mm:.{digits}f} mm is beyond the limit of {limit_mm:g} mm.",
    to_do="Calibrate again, then verify again.",
    meaning="A figure of the verification exceeds its limit by more than its uncertainty.",
    decided=_RULE,
    usual_causes="The scanner was moved after the calibration, or the limit is tighter than the cell can hold.",
    fixed=True,
)

VERIFY_CONDITIONAL_FAIL = Code(
    "verify-conditional-fail",
    "warning",
    text="{title}: {value_mm:.{digits}f} ± {uncertainty_mm:.{digits}f} mm is above the limit of {limit_mm:g} mm, by less than "
    "its uncertainty.",
    to_do="Calibrate again, or take more captures of the verification, turned further.",
    meaning="A figure of the verification is above its limit, but its uncertainty reaches below it.",
    decided=_RULE,
    usual_causes="The scanner was moved a little, or there are few captures.",
    fixed=True,
)

VERIFY_CONDITIONAL_PASS = Code(
    "verify-conditional-pass",
    "warning",
    text="{title}: {value_mm:.{digits}f} ± {uncertainty_mm:.{digits}f} mm is below the limit of {limit_mm:g} mm, by less than "
    "its uncertainty.",
    to_do="Take more captures of the verification, turned further.",
    meaning="A figure of the verification is below its limit, but its uncertainty reaches above it.",
    decided=_RULE,
    usual_causes="Few captures, or captures that are turned little against each other.",
    fixed=True,
)

VERIFY_UNDECIDED = Code(
    "verify-undecided",
    "warning",
    text={
        "uncertainty": "{title}: the uncertainty, ± {uncertainty_mm:.{digits}f} mm, is larger than the limit of "
        "{limit_mm:g} mm: nothing is decided.",
        "captures": "{title}: {count} captures count, too few to decide on the limit of {limit_mm:g} mm.",
    },
    to_do={
        "uncertainty": "Take more captures of the verification, turned further.",
        "captures": "Take more captures of the verification, from poses that were not used for the calibration.",
    },
    by="why",
    meaning="What was captured for the verification does not decide whether a figure holds its limit.",
    decided="U (k = 2) is above the limit, or fewer captures count than the figure needs.",
    usual_causes="Too few captures, or captures that were used for the calibration and therefore do not count.",
    fixed=True,
)

NOT_HELD_OUT = Code(
    "verify-not-held-out",
    "warning",
    text={
        "files": Plural(
            "{captures} has the same file as a capture of the calibration: it does not count.",
            "{captures} have the same files as captures of the calibration: they do not count.",
        ),
        "points": Plural(
            "{captures} has the same points as a capture of the calibration: it does not count.",
            "{captures} have the same points as captures of the calibration: they do not count.",
        ),
        "poses": Plural(
            "{captures} was taken at a pose of the calibration: it does not count.",
            "{captures} were taken at poses of the calibration: they do not count.",
        ),
    },
    to_do="Take captures from poses that were not used for the calibration.",
    by="same",
    reason="calibrated as {other}",
    meaning="A capture of the verification is one of the calibration, or stands at its pose: it says nothing new.",
    decided="The same file, all points within 1 µm, or the flange within 0.1 mm and 0.01° of one that calibrated.",
    usual_causes="Files copied from the calibration, or its robot program driven once more.",
    fixed=True,
)

CAPTURES_DISAGREE = Code(
    "verify-captures-disagree",
    "warning",
    text=Plural(
        "{captures} does not agree with the other captures of the verification: {sigmas:.1f} sigmas off.",
        "{captures} do not agree with the other captures of the verification: up to {sigmas:.1f} sigmas off.",
    ),
    to_do="Look at their poses; take them again, or leave them out and say why.",
    meaning="All other captures together, whatever tool they ask for, predict this one elsewhere.",
    decided="Each is predicted from the others; chance names one of a right set in fewer than 0.5 % of cases.",
    usual_causes="A pose that belongs to another capture, an arm still moving, or a sphere that was touched.",
)

SEEN_ONCE = Code(
    "verify-seen-once",
    "warning",
    text={
        "sphere": "{captures} is the only capture of the sphere '{sphere}': it is left out, the rest is judged.",
        "scanner": "{captures} is the only capture by the scanner '{sphere}': it is left out, the rest is judged.",
    },
    to_do="Capture it again, or give its capture the right mounting.",
    by="only",
    reason="the only capture of '{sphere}'",
    meaning="One capture of a sphere, or by a scanner, shows nothing of its own scatter and can disagree with nothing.",
    decided="Fewer than two captures of a sphere by one scanner.",
    usual_causes="A mistyped `mount`, or one of two captures that was excluded or did not show the sphere.",
)

POINTS_OFF_BALL = Code(
    "verify-points-off-ball",
    "warning",
    text="Points lie up to {off_mm:.1f} mm off the ball, whatever tool is tried ({captures}): nothing is decided.",
    to_do="Check the ball's diameter and that each capture has its own pose, then verify again.",
    meaning="No tool and no place of the ball bring these points onto it, so that no figure can be judged by them.",
    decided="More than a quarter of the captures' points lie more than 1 mm and 4 % of the radius off the ball (RMS).",
    usual_causes="Poses that belong to other captures, another ball, a ball that was moved.",
    fixed=True,
)

VERIFY_SIDES_OPEN = Code(
    "verify-sides-open",
    "warning",
    text="On which side of the plane of light the ball was stays open, and the tool's error depends on it: nothing is "
    "decided.",
    to_do="Turn the flange further between the captures, or tell the side of each.",
    meaning="A profile is alike on both sides of the ball. Here two choices of sides are nearly as likely.",
    decided="Other sides are less than 150 times less likely and move the tool by more than 0.1 mm.",
    usual_causes="Captures that are turned little against each other.",
    fixed=True,
)

VERIFIED_ANSWER_FAILS = Code(
    "verify-of-failed-answer",
    "warning",
    text="The answer that is verified, of the {stage} stage, fails by itself.",
    to_do="Mend that first.",
    meaning="A verification says little of an answer whose own result must not be used.",
    decided="The result of the stage that is verified has the verdict `fail`.",
    usual_causes="A calibration that was not finished.",
)

TOOL_WITHOUT_UNCERTAINTY = Code(
    "verify-tool-without-uncertainty",
    "warning",
    text="The tool was brought without an uncertainty: how large the scatter may be is not known.",
    to_do="Solve the TCP from captures of this session, or give the robot's repeatability.",
    meaning="A scatter is judged by what the answer and the robot allow.",
    decided="Neither the tool's covariance nor the robot's repeatability is told.",
    usual_causes="A tool that was typed in.",
)

JOINT_MOVED = Code(
    "joint-zero-moved",
    "warning",
    text="The zero of joint {joint} moved by {deg:.3f} ± {uncertainty_deg:.3f}° since the calibration: that explains what "
    "the captures show.",
    to_do="Have the robot's zeros checked, then calibrate again.",
    meaning="Arm and joints are known, and one joint's zero makes the captures of the verification 50 times likelier than "
    "any other joint, a scanner that moved, or the whole arm.",
    decided="What this zero leaves of the captures' scatter is chance.",
    usual_causes="A collision, a joint that lost its zero or was mastered anew.",
)

SCATTER_LARGE = Code(
    "verify-scatter-large",
    "warning",
    text="The held-out captures scatter {factor:.1f} times as much as their and the answer's uncertainty allow: "
    "{scatter_mm:.3f} mm, {expected_mm:.3f} mm are expected.",
    to_do="Look at the captures' poses; solve again with all captures, or calibrate again.",
    meaning="The answer's stated uncertainty does not explain how far the held-out captures lie apart.",
    decided="Chance gives such a scatter in fewer than one of a hundred cells.",
    usual_causes="A robot less accurate than told, a scanner that moved a little after the calibration.",
)

TOOL_MOVED = Code(
    "verify-tool-moved",
    "warning",
    text="The held-out captures ask for the scanner at another place: {off_mm:.2f} ± {uncertainty_mm:.2f} mm off where it "
    "saw the sphere, more than the answer's uncertainty allows.",
    to_do="Look whether the scanner or its mount was touched; calibrate again.",
    meaning="Another pose of the scanner explains these captures better than chance would, whatever the sphere's place.",
    decided="By the covariance of answer, captures and arm together a right answer shows as much once in 200 cells. A limit "
    "of the tool's error decides instead where one is set.",
    usual_causes="A scanner, its mount or a tracker's tripod that was moved a little after the calibration.",
    since="0.2",
)

SCATTER_FAILS = Code(
    "verify-scatter-fails",
    "error",
    text="The held-out captures scatter {factor:.1f} times as much as their and the answer's uncertainty allow: "
    "{scatter_mm:.3f} mm, {expected_mm:.3f} mm are expected.",
    to_do="Calibrate again.",
    meaning="The answer does not hold for captures that it was not solved from, and no limits say otherwise.",
    decided="The scatter is more than three times as large as expected, and no limits are set.",
    usual_causes="A scanner that was moved after the calibration, poses of another program.",
    fixed=True,
)

LIMIT_NOT_CHECKED = Code(
    "verify-limit-not-checked",
    "warning",
    text="{what}: the limit of {limit_mm:g} mm was not checked.",
    to_do="{to_do}",
    meaning="A limit was set, and the captures do not give the figure that it is for.",
    decided="The figure is missing among the checks.",
    usual_causes="No captures of the sphere, of the second sphere, or of the plate.",
    fixed=True,
)

_CHANGED = {
    "set": Plural(
        "The {what} was set after {count} capture: {after_mm:g} mm.",
        "The {what} was set after {count} captures: {after_mm:g} mm.",
        by="count",
    ),
    "removed": Plural(
        "The {what} was removed after {count} capture: it was {before_mm:g} mm.",
        "The {what} was removed after {count} captures: it was {before_mm:g} mm.",
        by="count",
    ),
    "changed": Plural(
        "The {what} was changed after {count} capture: {before_mm:g} → {after_mm:g} mm.",
        "The {what} was changed after {count} captures: {before_mm:g} → {after_mm:g} mm.",
        by="count",
    ),
}

LIMIT_EASED = Code(
    "verify-limit-eased",
    "warning",
    text=_CHANGED,
    by="how",
    meaning="A limit that is eased when the captures are known can be set so that they pass.",
    decided="After the first capture a limit was set, removed or raised, and lets more pass now than before.",
    usual_causes="A limit that was told wrongly at first.",
    fixed=True,
)

LIMIT_CHANGED = Code(
    "verify-limit-changed",
    "note",
    text=_CHANGED,
    by="how",
    meaning="A limit, or the ball bar's length, was changed when captures were there; it lets no more pass.",
    decided="The session keeps each change of its limits after the first capture.",
)

PLATE_NOT_TURNED = Code(
    "plate-not-turned",
    "warning",
    text="All captures of the plate are within {turned_deg:.0f}° of one orientation, so the tool's error hardly shows in "
    "its flatness.",
    to_do="Turn the flange between them, about the plate's normal too.",
    meaning="A plate that is always seen the same way looks flat with a wrong tool too.",
    decided="No two captures of the plate are turned by 10° or more.",
    usual_causes="A plate that was scanned along one path.",
)

POINTS_BESIDE_PLATE = Code(
    "points-beside-plate",
    "note",
    text=Plural(
        "{count} point beside the plate's plane was left out of its flatness.",
        "{count} points beside the plate's plane were left out of its flatness.",
        by="count",
    ),
    meaning="What lies far from the plate's plane is not of the plate.",
    decided="Ten robust standard deviations and more than 1 mm from the plane.",
)

PLATE_WITHOUT_LIMIT = Code(
    "plate-without-limit",
    "warning",
    text="No limit of the flatness is set, and a plate alone has nothing else to be judged by.",
    to_do="Set cell.verification.flatness_mm, or capture the sphere as well.",
    meaning="The plate's flatness is a figure without a judgement.",
    decided="Only a plate was captured, and no limit of its flatness is set.",
)

PLATE_ALONE = Code(
    "plate-alone",
    "note",
    text="Only a flat plate was captured: how far the tool is off at a sphere was not looked at.",
    meaning="A plate shows errors across it, and none along it.",
    decided="No captures of the sphere are among those of the verification.",
)
