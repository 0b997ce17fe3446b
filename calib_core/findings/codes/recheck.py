"""Whether a calibration still holds, and whether board and sphere agree."""

from calib_core.findings.code import Code

STILL_HOLDS = Code(
    "calibration-holds",
    "note",
    text="The calibration still holds: a point is seen {change_mm:.2f} ± {uncertainty_mm:.2f} mm from where it was seen, which "
    "noise and the robot's repeatability explain.",
    meaning="Poses of the calibration were repeated, and the sphere appears where it did.",
    decided="The difference is one that noise and the robot's repeatability explain.",
)

CALIBRATION_CHANGED = Code(
    "calibration-changed",
    "error",
    text={
        "tool": "The scanner sits differently: a point is seen {change_mm:.2f} ± {uncertainty_mm:.2f} mm from where it was seen.",
        "tool-of-one": "The scanner '{scanner}' sits differently: a point is seen {change_mm:.2f} ± {uncertainty_mm:.2f} mm from "
        "where it was seen.",
        "sphere": "The sphere or the robot's base moved by {change_mm:.2f} ± {uncertainty_mm:.2f} mm; the scanner may be where it "
        "was.",
        "tool-or-sphere": "Scanner or sphere moved: a point is seen {change_mm:.2f} ± {uncertainty_mm:.2f} mm from where it was "
        "seen.",
        "tool-or-sphere-of-one": "The scanner '{scanner}' or the sphere moved: a point is seen {change_mm:.2f} ± "
        "{uncertainty_mm:.2f} mm from where it was seen.",
        "joint": "The zero of joint {joint} moved by {deg:.3f} ± {uncertainty_deg:.3f}°: the captures lie {change_mm:.2f} ± "
        "{uncertainty_mm:.2f} mm off.",
        "unclear": "The captures differ by {change_mm:.2f} ± {uncertainty_mm:.2f} mm from those of the calibration in a way that "
        "no moved sphere, scanner or joint explains.",
    },
    to_do={
        "tool": "Calibrate again.",
        "tool-of-one": "Calibrate again.",
        "sphere": "Put the sphere back, or calibrate again.",
        "tool-or-sphere": "Poses turned further apart tell which.",
        "tool-or-sphere-of-one": "Poses turned further apart tell which.",
        "joint": "Have the robot's zeros checked, then calibrate again.",
        "unclear": "See each capture, then calibrate again.",
    },
    by="changed",
    meaning="Poses of the calibration were repeated, and the sphere appears elsewhere.",
    decided="The difference is beyond what noise and the robot's repeatability explain.",
    usual_causes="A collision, a loose scanner, a sphere or base that was moved, a joint that lost its zero.",
)

FEW_REPEATED = Code(
    "few-poses-repeated",
    "warning",
    text="{count} of {enough} captures.",
    to_do="Repeat more poses of the calibration, turned differently.",
    meaning="Few repeated poses say little of whether the calibration holds.",
    decided="Fewer captures than are needed to tell a moved scanner from a moved sphere.",
    usual_causes="A recheck that is not finished.",
)

POSE_NOT_REPEATED = Code(
    "pose-not-repeated",
    "note",
    text="{captures} not used: no capture of the calibration within 20 mm and 3° of the pose.",
    to_do="Drive to a pose of the calibration.",
    reason="no capture of the calibration within 20 mm and 3° of its pose. Drive to a pose of the calibration",
    meaning="Only repeated poses are compared.",
    decided="The nearest pose of the calibration is more than 20 mm or 3° away.",
    usual_causes="Another program, another frame.",
)

CAMERA_WEAK = Code(
    "camera-on-flange-weak",
    "warning",
    text="Where the camera is, these frames hardly determine.",
    to_do="Take the board from more robot poses, turned by 20° about different axes.",
    meaning="The frames leave the camera's pose on what carries it uncertain.",
    decided="Its standard deviation is above the limit of a good answer.",
    usual_causes="Few robot poses, or poses turned about one axis.",
)

BOARD_AND_SPHERE_DIFFER = Code(
    "board-and-sphere-differ",
    "warning",
    text="Board and sphere give tools {shift_mm:.3f} mm and {turn_deg:.3f}° apart, {times:.1f} of both uncertainties.",
    to_do="Check the board's pitch, the sphere's diameter, and that neither board nor sphere nor scanner moved in between.",
    meaning="Two independent ways to the same tool do not agree.",
    decided="Chance gives such a difference in fewer than one of a hundred cells.",
    usual_causes="A wrong pitch or diameter, something that moved in between.",
)
