"""What a verification notices: its decision, captures that do not count, captures that do not agree."""

from calib_core.findings.code import Code, Plural

_RULE = (
    "By the decision rule of ISO 14253-1 with a guard band of U (k = 2), fixed before measuring: pass up to the "
    "limit less U, conditional pass up to the limit, conditional fail up to the limit plus U, fail beyond."
)

VERIFY_FAIL = Code(
    "verify-fail",
    "error",
    text="{title}: {value_mm:.3f} ± {uncertainty_mm:.3f} mm is beyond the limit of {limit_mm:g} mm.",
    to_do="Calibrate again, then verify again.",
    meaning="A figure of the verification exceeds its limit by more than its uncertainty.",
    decided=_RULE,
    usual_causes="The scanner was moved after the calibration, or the limit is tighter than the cell can hold.",
    fixed=True,
)

VERIFY_CONDITIONAL_FAIL = Code(
    "verify-conditional-fail",
    "warning",
    text="{title}: {value_mm:.3f} ± {uncertainty_mm:.3f} mm is above the limit of {limit_mm:g} mm, by less than "
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
    text="{title}: {value_mm:.3f} ± {uncertainty_mm:.3f} mm is below the limit of {limit_mm:g} mm, by less than "
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
        "uncertainty": "{title}: the uncertainty, ± {uncertainty_mm:.3f} mm, is larger than the limit of "
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
