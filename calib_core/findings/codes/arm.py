"""What is noticed of the robot's arm, where its joints are known."""

from calib_core.findings.code import Code

ARM_WORTH_IT = Code(
    "arm-errors-worth-it",
    "note",
    text="With the arm's own errors solved, other poses are predicted to {after_mm:.2f} mm instead of "
    "{before_mm:.2f} mm (RMS of poses left out).",
    to_do="Set cell.robot.errors to 'apply' where whoever uses the poses can correct them.",
    meaning="Joints are known, and errors of the arm (zeros of joints, links, coupling, sag) explain the captures "
    "so much better that poses which were left out are predicted better, too.",
    decided="Groups of neighbouring poses are left out in turn. The likelihood must rise beyond chance and the "
    "error at poses left out fall by more than 5 %.",
    usual_causes="An arm that was never calibrated, or joints that were mastered anew.",
    since="0.2",
)

ARM_APPLIED = Code(
    "arm-errors-applied",
    "note",
    text="Poses are corrected by the arm's own errors: other poses are predicted to {after_mm:.2f} mm instead of "
    "{before_mm:.2f} mm (RMS of poses left out).",
    to_do="The controller knows nothing of it: exports give the tool that is best with its own poses.",
    meaning="`cell.robot.errors` is `apply`: this stage and all later ones use corrected poses.",
    decided="As `arm-errors-worth-it`.",
    usual_causes="It was asked for.",
    since="0.2",
)

ARM_NOT_BETTER = Code(
    "arm-errors-not-better",
    "note",
    text="The arm's own errors are not applied: poses left out are predicted to {after_mm:.2f} mm with them and to "
    "{before_mm:.2f} mm without.",
    to_do="Add captures with other joint angles, or leave cell.robot.errors at 'cover'.",
    meaning="`cell.robot.errors` is `apply`, but a model of the arm does not predict other poses better.",
    decided="As `arm-errors-worth-it`.",
    usual_causes="A right arm, or too few captures with too little motion of the joints.",
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
