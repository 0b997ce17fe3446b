"""What is noticed of the robot's arm: its errors, its joints, and how truly it tells where it stands."""

from calib_core.findings.code import Code

ARM_WORTH_IT = Code(
    "arm-errors-worth-it",
    "note",
    text={
        "held-out": "With the arm's own errors solved, other poses are predicted to {after_mm:.2f} mm instead of "
        "{before_mm:.2f} mm (RMS of poses left out).",
        "likelihood": "The captures are likelier with the arm's own errors beyond chance; poses left out cannot "
        "tell ({before_mm:.2f} mm without them, {after_mm:.2f} mm with them).",
    },
    by="decided_by",
    to_do="Set cell.robot.errors to 'apply' where whoever uses the poses can correct them.",
    meaning="Joints are known, and errors of the arm (zeros of joints, links, coupling, sag) explain the captures "
    "better than chance would; poses which were left out are predicted better, too, or cannot tell.",
    decided="The likelihood must rise by a factor of e, where a right arm's rises by a tenth. Groups of neighbouring "
    "poses are left out in turn: their error must not rise by more than the standard deviation of its change.",
    usual_causes="An arm that was never calibrated, or joints that were mastered anew.",
    since="0.2",
)

ARM_APPLIED = Code(
    "arm-errors-applied",
    "note",
    text={
        "held-out": "Poses are corrected by the arm's own errors: other poses are predicted to {after_mm:.2f} mm instead of "
        "{before_mm:.2f} mm (RMS of poses left out).",
        "likelihood": "Poses are corrected by the arm's own errors: the captures are likelier with them beyond chance; poses "
        "left out cannot tell ({before_mm:.2f} mm without them, {after_mm:.2f} mm with them).",
    },
    by="decided_by",
    to_do="The controller knows nothing of it: exports give the pose of the scanner that is best with its own poses.",
    meaning="`cell.robot.errors` is `apply`: this stage and all later ones use corrected poses.",
    decided="As `arm-errors-worth-it`.",
    usual_causes="It was asked for.",
    since="0.2",
)

ARM_NOT_BETTER = Code(
    "arm-errors-not-better",
    "note",
    text={
        "held-out": "The arm's own errors are not applied: poses left out are predicted to {after_mm:.2f} mm with them and to "
        "{before_mm:.2f} mm without.",
        "likelihood": "The arm's own errors are not applied: the captures are not likelier with them beyond chance (poses "
        "left out: {before_mm:.2f} mm without them, {after_mm:.2f} mm with them).",
    },
    by="decided_by",
    to_do="Add captures with other joint angles, or leave cell.robot.errors at 'cover'.",
    meaning="`cell.robot.errors` is `apply`, but a model of the arm explains the captures no better than chance, or other poses worse.",
    decided="As `arm-errors-worth-it`.",
    usual_causes="A right arm, or too few captures with too little motion of the joints.",
    since="0.2",
)

ARM_WITHOUT_JOINTS = Code(
    "arm-errors-without-joints",
    "warning",
    text={
        "arm": "The arm's own errors are not applied: nothing says which arm it is.",
        "joints": "The arm's own errors are not applied: joints are known of {known} of {count} captures.",
    },
    to_do={
        "arm": "Choose it (cell.robot.arm), or leave cell.robot.errors at 'cover'.",
        "joints": "Give all captures their joints, exclude those without, or leave cell.robot.errors at 'cover'.",
    },
    by="lacks",
    meaning="`cell.robot.errors` is `apply`, and the arm's errors are found by its lengths and the joints of all captures.",
    decided="No arm is told, or a capture that is used has no joints.",
    usual_causes="Poses that were typed in, or read from a file without joints.",
    since="0.2",
)

JOINTS_READ_OTHERWISE = Code(
    "joints-read-otherwise",
    "warning",
    text="The joints of {apart} of {count} captures do not give their poses: {likely} would.",
    to_do="Correct the joints or cell.robot.arm; the arm's errors are not looked for until they agree.",
    meaning="Joints and poses contradict each other, and one change of the joints or of the arm mends it.",
    decided="Other orders, signs, zeros, units, couplings and named arms are tried: with one of them the joints give "
    "the poses of four captures in five, to 5 mm and 1°.",
    usual_causes="Joints copied in another order or sign, in radians, or of a controller whose third joint moves "
    "along with the second; another arm than named.",
    since="0.2",
)

ARM_LENGTHS = Code(
    "arm-lengths-off",
    "warning",
    text="The robot's poses seem too long by {error_percent:.2f} ± {uncertainty_percent:.2f} %, or the scanner's "
    "lengths too short by as much: the captures hardly tell which.",
    to_do="Check the arm's calibration, the scanner's own and the sphere's diameter.",
    meaning="Lengths of arm and scanner do not agree.",
    decided="The factor differs from one beyond chance.",
    usual_causes="An arm that was never calibrated, a scanner's wrong scale.",
)

ARM_LESS_TRUE = Code(
    "arm-less-true-than-told",
    "note",
    text="The captures agree to {found_mm:.2f} mm where the robot's sigma says {told_mm:.2f} mm: an arm repeats better "
    "than it is true.",
    to_do="The stated uncertainty holds it.",
    meaning="Makers tell how well an arm repeats; what it errs beyond that is estimated and counted.",
    decided="The estimated standard deviation is more than 1.5 times the one told.",
    usual_causes="A sigma from a data sheet.",
    behind=("table-scatter-beyond-told", "balls-not-told-apart", "poses-do-not-fit"),
)

LAG_NOT_CHECKED = Code(
    "lag-not-checked",
    "note",
    text="Not checked: a lag that is always in one direction, and errors of the arm that all captures share.",
    to_do="Approach some poses from another side and let the arm come to rest to show them.",
    meaning="A lag that is always in one direction of the flange looks like the tool's own shift.",
    decided="No pose was taken again after the arm had been elsewhere.",
)

POSES_REPEAT = Code(
    "poses-repeat",
    "note",
    text="Poses taken again after the arm had been elsewhere differ by {shift_mm:.3f} mm at most ({captures}): where "
    "they were reached from another side, a lag is no larger.",
    to_do="Not checked: errors of the arm that all captures share.",
    meaning="Poses that were reached twice check lag and play of the arm.",
    decided="The sphere appears less far apart than chance and three standard deviations of the poses allow.",
)

ARM_LAGS = Code(
    "arm-lags",
    "warning",
    text="{captures} are one pose, reached twice, but see the sphere {shift_mm:.2f} mm apart: the arm lags or has "
    "play, or the sphere moved.",
    to_do="By as much the TCP may be off in the direction of approach: let the arm come to rest before each capture.",
    meaning="A pose that was reached twice shows the sphere at two places.",
    decided="The shift is beyond three standard deviations of two poses, beyond that of the fits, and above 0.05 mm.",
    usual_causes="Captures while the arm still moves, play in a joint, a sphere that was touched.",
)

POSES_LAG = Code(
    "poses-lag",
    "warning",
    text="The robot seems to be {lag_mm:.2f} mm behind its reported poses, along its way from one capture to the next.",
    to_do="Let it stand still before each capture, and read the pose afterwards.",
    meaning="Captures lie off where their poses put them, each along the way on which the robot came.",
    decided="One unknown more, a length or a share of the way, makes all captures likelier by a factor that chance gives in "
    "one of 1,000 sessions.",
    usual_causes="Poses that are read while the robot moves, commanded poses instead of reached ones, play in the gears.",
)

NOT_THE_FLANGE = Code(
    "poses-not-of-the-flange",
    "warning",
    text="{whose}",
    to_do="The answer is of these poses: give those of the flange, or enter the tool in the controller as they do.",
    meaning="The joints of a known arm tell the flange, and the poses are those of something else.",
    decided="One tool or one frame brings all poses to the flange that the joints give.",
    usual_causes="The controller reported its active tool or frame.",
    title={
        "tool": "Poses are of a tool, not of the flange",
        "frame": "Poses are in another frame, not in the base",
        "both": "Poses are of a tool in another frame, not of the flange",
    },
    by="of",
)

JOINTS_CONTRADICT = Code(
    "joints-contradict-poses",
    "warning",
    text="The joints of {apart} of {count} captures do not give their poses.",
    to_do="Check the arm (cell.robot.arm), the joints' order and signs, and the pose convention.",
    meaning="Joints and poses of most captures are not of one arm.",
    decided="More than half of the captures are apart, by more than an arm's error.",
    usual_causes="Another arm than named, joints in another order or sign.",
)
