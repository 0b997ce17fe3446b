"""What the laser-plane stage notices: the plane of light, the lines on the boards, the camera."""

from calib_core.findings.code import Code, Plural

LINE_OFF_PLANE = Code(
    "line-off-plane",
    "note",
    text=Plural(
        "{captures} is not used: its line lies {off_mm:.2f} mm off the plane of the others: the board or the camera was "
        "moved.",
        "{captures} are not used: their lines lie off the plane of the others ({off_mm:.2f} mm in the first): the boards "
        "or the camera were moved.",
    ),
    reason="its line lies {off_mm:.2f} mm off the plane of the others: the board or the camera was moved",
    meaning="One line contradicts the plane that all others agree on; it is left out.",
    decided="It lies several times as far off as the others; by what scatters these it would in less than one of 10,000.",
    usual_causes="A board that moved between the lit frame and the one with the stripe.",
)

NO_LINE_ON_BOARD = Code(
    "no-line-on-board",
    "note",
    text=Plural(
        "{captures} is not used: no laser line is seen on the board.",
        "{captures} are not used: no laser line is seen on the board.",
    ),
    to_do="Switch the laser on and let its line cross the board.",
    reason="no laser line is seen on the board: switch the laser on and let its line cross the board",
    meaning="The board is seen, the stripe on it is not.",
    decided="Fewer points of a straight line than are needed lie on the board.",
    usual_causes="The laser was off, or its line passes beside the board.",
)

LINES_TOO_CLOSE = Code(
    "board-lines-close",
    "warning",
    text={
        "apart": "The lines on the boards lie close to each other: {width_mm:.1f} mm across for {length_mm:.0f} mm along "
        "(standard deviations), so the plane can still turn about them.",
        "parallel": "The lines on the boards lie close to each other and nearly parallel (within {angle_deg:.1f}°): "
        "{width_mm:.1f} mm across for {length_mm:.0f} mm along (standard deviations), so the plane can still turn "
        "about them.",
    },
    by="how",
    to_do="Capture boards nearer and farther away.",
    meaning="A plane through lines that lie in one line can turn about it.",
    decided="The lines' points spread less than a tenth as far across as along.",
    usual_causes="Boards at one distance.",
)

PLANE_NORMAL_WEAK = Code(
    "plane-normal-weak",
    "warning",
    text="The plane's normal is known only to ±{normal_deg:.2f}° (k = 2).",
    to_do="Capture boards nearer and farther away.",
    meaning="The direction of the plane of light is uncertain: what is measured far from the boards is off.",
    decided="Its standard deviation is above 0.1°.",
    usual_causes="Few boards, boards at one distance.",
)

FEW_BOARDS = Code(
    "few-boards-carry-plane",
    "warning",
    behind=("board-not-as-told",),
    text=Plural("Only {count} board carries the plane.", "Only {count} boards carry the plane.", by="count"),
    to_do="Take five or more: they let a bad one be found out.",
    meaning="With few boards a moved one is not found out.",
    decided="Fewer than 4 boards are used.",
    usual_causes="A short series.",
)

PLANE_NOT_FINITE = Code(
    "plane-not-determined",
    "error",
    text="The plane is not determined: its figures are not finite.",
    to_do="Capture more boards, near, far and tilted.",
    meaning="The captures do not fix a plane.",
    decided="A figure of the plane is infinite or no number.",
    usual_causes="Boards at one place.",
    fixed=True,
)

PLANE_NORMAL_OPEN = Code(
    "plane-normal-open",
    "error",
    text="The plane's normal is known only to ±{normal_deg:.1f}° (k = 2).",
    to_do="Capture boards nearer and farther away.",
    meaning="The direction of the plane of light is as good as open.",
    decided="Its standard deviation is above 2°.",
    usual_causes="Boards at one distance.",
    fixed=True,
)

PLANE_THROUGH_CAMERA = Code(
    "plane-through-camera",
    "error",
    text="The plane runs through the camera's centre within its uncertainty ({distance_mm:.2f} ± {uncertainty_mm:.2f} "
    "mm): such a laser gives no depth.",
    to_do="Check board, pitch and camera.",
    meaning="A stripe in a plane through the camera's centre is the same line at every distance.",
    decided="The distance is below 3 of its standard deviations.",
    usual_causes="Frames of another camera, boards that were misread.",
    fixed=True,
)

MOST_LINES_OFF = Code(
    "most-lines-off-plane",
    "error",
    text="{rejected} of {count} lines lie off the plane of the others: boards or camera moved, or the pitch is wrong.",
    to_do="Fix camera and boards, check cell.board.pitch_mm, and take them again.",
    meaning="No plane fits most of the lines.",
    decided="More than half of the lines are left out.",
    usual_causes="A camera that was moved, a wrong pitch.",
    fixed=True,
)

CAMERA_HELD = Code(
    "camera-not-refined",
    "note",
    text={
        "drawn": "The camera is the one that the boards' corners gave: the stripes would have drawn it by more than three "
        "of its standard deviations. Its uncertainty is in the plane's.",
        "worse": "The camera is the one that the boards' corners gave: with the stripes, corners of other boards are met "
        "{worsened:.1%} worse. Its uncertainty is in the plane's.",
    },
    by="course",
    meaning="Stripes on boards can refine the camera; here they were not let.",
    decided="The refined camera lies more than three standard deviations off, or foretells held-out corners worse.",
)

FOCUS_CHANGED = Code(
    "focus-changed",
    "warning",
    text={
        "longer": "The boards with the stripe were seen with a focal length that is {change:.1%} longer (± "
        "{uncertainty:.1%}, k = 2) than that of the other boards: focus or zoom was changed between them.",
        "shorter": "The boards with the stripe were seen with a focal length that is {change:.1%} shorter (± "
        "{uncertainty:.1%}, k = 2) than that of the other boards: focus or zoom was changed between them.",
        "longer-than-told": "The boards with the stripe were seen with a focal length that is {change:.1%} longer (± "
        "{uncertainty:.1%}, k = 2) than that of the told camera: it was focused or zoomed since.",
        "shorter-than-told": "The boards with the stripe were seen with a focal length that is {change:.1%} shorter (± "
        "{uncertainty:.1%}, k = 2) than that of the told camera: it was focused or zoomed since.",
    },
    by="how",
    to_do="Lock focus and zoom, and take all frames of boards again, also those of a camera that is told.",
    meaning="Camera and plane of light are of two lenses: the plane is farther off than its ± says.",
    decided="By their corners alone the focal lengths differ by more than four standard deviations and 0.5 %; four boards "
    "or more of each are needed, six beside a told camera.",
    usual_causes="Autofocus, a ring that was turned, images that were cropped or scaled.",
)

BOARD_PITCH_IN_OTHER_UNIT = Code(
    "board-pitch-unit",
    "warning",
    text={
        "m": "By the board's pitch as told, all lines of light lie within {length_mm:.2g} mm: it looks like metres.",
        "um": "By the board's pitch as told, the lines of light span {length_mm:.2g} mm: it looks like micrometres.",
    },
    by="unit",
    to_do="Give cell.board.pitch_mm in millimetres, and solve again.",
    meaning="All lengths of frames scale with the board's pitch, and no cell is as small or as large as these.",
    decided="The lines on all boards together span less than 2 mm or more than 20 m.",
    usual_causes="A pitch in metres or in micrometres.",
)
