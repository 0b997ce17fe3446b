"""Why captures are kept but not used."""

from calib_core.findings.code import Code, Plural

CAPTURE_MOVING = Code(
    "capture-while-moving",
    "warning",
    text=Plural(
        "{captures} is not used: the robot was moving, and a single capture needs it to stand still.",
        "{captures} are not used: the robot was moving, and single captures need it to stand still.",
    ),
    to_do="Take it again at rest.",
    reason="the robot was moving, and a single capture needs it to stand still",
    meaning="The pose of a capture that was taken while the robot moved is not known well enough.",
    decided="The capture says that the robot was moving.",
    usual_causes="A trigger before the arm had come to rest.",
)

CAPTURE_OF_OTHER_SCANNER = Code(
    "capture-of-unknown-scanner",
    "warning",
    text=Plural(
        "{captures} is not used: its scanner {scanner} is none of the cell's ({known}).",
        "{captures} are not used: their scanner {scanner} is none of the cell's ({known}).",
    ),
    to_do="Correct the scanner's name in the captures, or add the scanner to the cell.",
    reason="its scanner {scanner} is none of the cell's ({known})",
    meaning="The capture names a scanner that the cell does not have.",
    decided="The name is not in cell.scanners.",
    usual_causes="A typing error, a scanner that was renamed.",
)

CAPTURE_OF_NO_SCANNER = Code(
    "capture-without-scanner",
    "warning",
    text=Plural(
        "{captures} does not say which scanner took it: it counts as of {scanner}, the first of the cell's ({known}).",
        "{captures} do not say which scanner took them: they count as of {scanner}, the first of the cell's ({known}).",
    ),
    to_do="Name the scanner in each of these captures.",
    meaning="The cell has several scanners, and the capture names none.",
    decided="cell.scanners has several names, and the capture has no field scanner.",
    usual_causes="Captures from before the cell had a second scanner, a program that leaves the field out.",
)

CAPTURE_WITHOUT_READING = Code(
    "capture-without-axis-reading",
    "warning",
    text=Plural(
        "{captures} is not used: it does not say where the axis {axis} stood.",
        "{captures} are not used: they do not say where the axis {axis} stood.",
    ),
    to_do="Add the axis's reading to the captures.",
    reason="it does not say where the axis {axis} stood",
    meaning="The cell has an axis, and where it stood in the capture is not known.",
    decided="The axis is in cell.axes, and the capture has no reading of it.",
    usual_causes="A reading that was forgotten, an axis that was added to the cell later.",
)

CAPTURE_OF_OTHER_TOOL = Code(
    "capture-of-other-setting",
    "warning",
    text={
        "tool": "{captures} not used: another tool was active, {own}; in most captures of the step it is {usual}.",
        "frame": "{captures} not used: another frame was active, {own}; in most captures of the step it is {usual}.",
        "scanner": "{captures} not used: another scanner saw it, {own}; in most captures of the step it is {usual}.",
    },
    to_do="Take it again as the others, or exclude it.",
    reason={
        "tool": "its tool is {own}, that of most captures of its step {usual}",
        "frame": "its frame is {own}, that of most captures of its step {usual}",
        "scanner": "its scanner is {own}, that of most captures of its step {usual}",
    },
    by="setting",
    meaning="Poses are of one tool in one frame only where the controller had the same ones active.",
    decided="The capture's active tool, active frame or scanner is not that of most captures of its step.",
    usual_causes="A program that changed the tool or frame in between.",
)

CAPTURE_NOT_BY_JOINTS = Code(
    "capture-joints-apart",
    "warning",
    text=Plural(
        "{captures} is not used: its joints put the flange {shift_mm:.0f} mm and {turn_deg:.1f}° from its pose: one "
        "of the two is another capture's.",
        "{captures} are not used: their joints put the flange elsewhere than their poses ({shift_mm:.0f} mm and "
        "{turn_deg:.1f}° in the first): one of the two is another capture's.",
    ),
    to_do="Enter joints and pose of one moment, or take it again.",
    reason="its joints put the flange {shift_mm:.0f} mm and {turn_deg:.1f}° from its pose: one of the two is another "
    "capture's",
    meaning="Joints and pose of the capture are of two moments.",
    decided="They differ by more than an arm's error, while those of most captures agree.",
    usual_causes="A pose or joints copied from another capture.",
)

CAPTURE_DUPLICATE = Code(
    "capture-duplicate",
    "warning",
    text=Plural(
        "{captures} is not used: it is a duplicate of {original}: the same file and pose, counted once.",
        "{captures} are not used: they are duplicates of others ({original} is the first's): the same file and pose, "
        "counted once.",
    ),
    to_do="Remove it.",
    reason="a duplicate of {original}: the same file and pose, counted once",
    meaning="A measurement never repeats byte for byte: one of the two is a copy.",
    decided="File, pose and table angle are the same.",
    usual_causes="A capture that was uploaded twice.",
)

CAPTURE_OF_NO_BALL = Code(
    "capture-of-no-ball",
    "warning",
    text=Plural(
        "{captures} is not used: what looks like a ball in it is where none of the cell's balls is.",
        "{captures} are not used: what looks like a ball in them is where none of the cell's balls is.",
    ),
    to_do="Look for a reflection or another round thing there, or capture that ball from at least three poses.",
    reason="what looks like a ball is where none of the cell's balls is",
    meaning="Several balls were told apart by where each is; this arc fits none of them.",
    decided="It lies more than 4 mm from every ball that at least three captures show.",
    usual_causes="A reflection of a ball, another round thing, or a ball that only one or two captures show.",
)

CAPTURE_NOT_MEASURED = Code(
    "capture-not-measured",
    "warning",
    text=Plural(
        "{captures} is not used: need {need}, got {got}.",
        "{captures} are not used: need {need}, got {got} (so in {first}; the others alike).",
    ),
    to_do="{to_do}",
    reason="need {need}, got {got}. {to_do}",
    meaning="What is to be measured cannot be found in the capture, or does not fit.",
    decided="The measuring of the capture says what it needs and what it found.",
    usual_causes="A sphere or board out of view, glare, another exposure, another file.",
)

LOST_RAYS = Code(
    "stripe-beyond-distortion",
    "note",
    text=Plural(
        "{count} stripe centre was dropped: it lies beyond the fold of the camera's distortion, where a pixel has no "
        "ray.",
        "{count} stripe centres were dropped: they lie beyond the fold of the camera's distortion, where a pixel has "
        "no ray.",
        by="count",
    ),
    to_do="Show the board there, too, when the camera is calibrated.",
    meaning="A camera's distortion is known only where the board was seen; beyond, its formula folds back.",
    decided="The pixel lies beyond the fold of the distortion that was found.",
    usual_causes="Boards in the middle of the image alone.",
)
