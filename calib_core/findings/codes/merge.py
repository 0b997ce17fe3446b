"""What the merge of scans notices: mistakes that keep scans from fitting together, and doubts about the result."""

from calib_core.findings.code import Code, Plural

_APPLY = "Apply it, and solve the merge again."

SCAN_OF_NO_USE = Code(
    "scan-of-no-use", "warning",
    text="{captures} cannot be merged: {why}.",
    reason="{why}",
    meaning="A scan has no points on a surface, or its record contradicts the others.",
    decided="By the cleaning of its points, or by its record.",
    usual_causes="A scan that missed the object, another active tool, or a robot that was still moving.",
)  # fmt: skip

CALIBRATION_FAILED = Code(
    "merge-calibration-failed", "warning",
    text="The {stage} stage's own verdict is fail: fix that first.",
    meaning="Tool or table, by which the scans are placed, are not good.",
    decided="By the verdict of the stage that solved them.",
)  # fmt: skip

TABLE_DIRECTION_OF_SCANS = Code(
    "merge-table-direction", "error",
    text="The scans fit together if the table turned the other way round: {pairs_after:d} pairs of surfaces lie "
    "together then, {pairs_before:d} do now.",
    to_do=_APPLY,
    title="The table turns the other way round",
    meaning="The table's angles count in the other sense than the cell says.",
    decided="Every scan is turned by twice its angle; the pairs of surfaces that then lie together are counted.",
    usual_causes="`turntable.direction`, or the sign in which the table's controller counts.",
)  # fmt: skip

TABLE_STEPS_OF_SCANS = Code(
    "merge-table-steps", "error",
    text="The scans fit together if the table's angles are multiplied by {factor:.4g}: {pairs_after:d} pairs of "
    "surfaces lie together then, {pairs_before:d} do now.",
    to_do=_APPLY,
    title="The table's angles are to be multiplied by {factor:.4g}",
    meaning="The table's angles are told in another unit, or in steps of another size.",
    decided="Angles are multiplied by factors about 1 and by those of units; pairs of surfaces are counted.",
    usual_causes="Radians, gon, or a wrong number of steps to a turn.",
)  # fmt: skip

ONE_TABLE_ANGLE = Code(
    "merge-one-table-angle", "error",
    text="All scans have the table angle {angle_deg:g}°.",
    to_do="Give each the angle at which it was taken.",
    meaning="Scans of one object on a turntable have one and the same angle, and do not fit together.",
    decided="By their records, where the scans lie apart.",
)  # fmt: skip

SWAPPED_SCANS = Code(
    "merge-swapped-scans", "error",
    text={
        "pose": "{captures} fit if each has the pose of the other: {pairs_after:d} pairs of surfaces lie together "
        "then, {pairs_before:d} do now.",
        "angle": "{captures} fit if each has the table angle of the other: {pairs_after:d} pairs of surfaces lie "
        "together then, {pairs_before:d} do now.",
        "both": "{captures} fit if each has the pose and table angle of the other: {pairs_after:d} pairs of "
        "surfaces lie together then, {pairs_before:d} do now.",
    },
    by="what",
    to_do=_APPLY,
    title="{captures} are swapped",
    meaning="Two scans have each other's pose or angle.",
    decided="Scans that fit worst change places, two by two; the pairs of surfaces that then lie together are "
    "counted.",
    usual_causes="Files renamed or sorted by hand.",
)  # fmt: skip

POSES_READ_OTHERWISE = Code(
    "merge-pose-reading", "error",
    text="The scans fit together if their poses are {reading}: {pairs_after:d} pairs of surfaces lie together "
    "then, "
    "{pairs_before:d} do now.",
    to_do=_APPLY,
    title="Poses are {reading}",
    meaning="The numbers of the poses mean something else than the cell's convention says.",
    decided="The poses are read in every convention with as many numbers, in other units and the other way round; "
    "pairs of surfaces are counted.",
    usual_causes="Another brand's order of angles, metres, or the inverse of a pose.",
)  # fmt: skip

SCANS_IN_METRES = Code(
    "merge-scans-in-metres", "error",
    text=Plural(
        "{captures} looks like metres: it spans {extent_mm:.2g} mm, and fits if its points are multiplied by "
        "1000.",
        "{captures} look like metres: they span {extent_mm:.2g} mm, and fit if their points are multiplied by "
        "1000.",
    ),
    to_do=_APPLY,
    title="{captures}: metres",
    meaning="A file's points are in metres, and millimetres are taken.",
    decided="The points span a fiftieth of the others, or less than two millimetres in all scans; pairs of "
    "surfaces "
    "are counted with the points multiplied by 1000.",
)  # fmt: skip

SCAN_ELSEWHERE = Code(
    "merge-scan-elsewhere", "error",
    text=Plural(
        "{captures} is not where its pose puts it: the other scans fit together without it.",
        "{captures} are not where their poses put them: the other scans fit together without them.",
    ),
    to_do="Give the pose and angle at which it was taken; or apply to leave it out.",
    title="{captures}: elsewhere",
    meaning="A scan does not belong where its pose puts it.",
    decided="It lies beyond all others, or stands in lines of sight where the others hardly do; no other reading "
    "of its pose makes pairs appear.",
    usual_causes="The pose of another scan, a typing error, or an object that was moved.",
)  # fmt: skip

SCANS_DO_NOT_FIT = Code(
    "merge-scans-do-not-fit", "error",
    text="The scans do not fit together: {pairs:d} pairs of surfaces lie together, and {impossible_percent:.0f} "
    "% of "
    "the surfaces that lie one before the other stand in a scan's line of sight.",
    to_do="Check poses, table angles and units of all scans.",
    meaning="The poses do not belong to these scans, and nothing that was tried makes them fit.",
    decided="Fewer than a quarter of the surfaces one before the other may stand in a line of sight, a tenth where "
    "few lie together; in a right merge hardly any does.",
    fixed=True,
)  # fmt: skip

PLACE_OPEN = Code(
    "merge-place-open", "warning",
    text="Where the merged object lies in base is not determined: the captures leave a shift of all scans open.",
    to_do="Sizes and shapes hold. Where its place matters, tilt the flange while calibrating, or measure a point of it.",
    meaning="All scans are placed alike but for one shift, in which the merged cloud's coordinates are arbitrary.",
    decided="The calibration leaves the scanner's place open, and no table ties the scans to it.",
    usual_causes="A machine that does not turn its flange: a gantry, a SCARA, one linear axis.",
)  # fmt: skip

NO_OVERLAP = Code(
    "merge-no-overlap", "warning",
    text="No two scans overlap, so nothing says how well they fit together.",
    to_do="Scan some of the surface twice.",
    meaning="The promise of the calibration cannot be measured on these scans.",
    decided="No voxel was seen by two scans that face the same way.",
    behind=("merge-scans-do-not-fit", "merge-scans-in-metres", "merge-pose-reading", "merge-table-direction"),
)  # fmt: skip

SCANS_ALONE = Code(
    "merge-scans-alone", "warning",
    text=Plural(
        "Nothing says how well this fits: {captures} overlaps no other scan.",
        "Nothing says how well these fit: {captures} overlap no other scan.",
    ),
    to_do="Check pose and table angle, or scan some of their surface again.",
    meaning="A scan shares no surface with another one.",
    decided="It has no pair of surfaces with any other scan.",
)  # fmt: skip

SCANS_APART = Code(
    "merge-scans-apart", "warning",
    text="Scans lie {rms_mm:.3f} mm apart where {expected_mm:.3f} mm is expected, {worst} the farthest "
    "({worst_mm:.3f} mm).",
    to_do="Check its pose and table angle, and that the object did not move.",
    meaning="Something beyond noise and calibration moves the scans.",
    decided="The RMS distance is more than 1.5 times what noise and calibration make of it.",
)  # fmt: skip

SCANS_FAR_OFF = Code(
    "merge-scans-far-off", "warning",
    text="Far off where they overlap the others: {named}.",
    to_do="Check their poses and table angles, which may be those of another scan, and that the object did not "
    "move.",
    meaning="Single scans lie much farther off the others than is expected of them.",
    decided="A scan's own RMS is more than three times what is expected of it.",
)  # fmt: skip

SURFACE_INSIDE_OUT = Code(
    "merge-inside-out", "warning",
    text="Scans see through each other: the surface seems to be inside out.",
    to_do="Apply, so that the scans say themselves which way the scanner's z axis grows.",
    title="The scanner's z axis grows the other way",
    meaning="The scanner's z axis was told to grow one way, and who sees whom says the other.",
    decided="Four in five of the surfaces that lie one before the other stand in a scan's line of sight.",
)  # fmt: skip

OUTSIDE_DOUBTFUL = Code(
    "merge-outside-doubtful", "warning",
    text={
        "volume": "Which side of the surface is out was decided by its volume, and much of it is missing.",
        "visibility": "Which side of the surface is out was decided by who sees whom; the rays say the other.",
        "ball": "Which side of the surface is out was decided by captures of the ball; "
        "who sees whom says the other.",
        "assumed": "Nothing says which side of the surface is out: z is assumed to grow away from the scanner.",
    },
    by="how",
    to_do="Look at the mesh, and set cell.scanner.z_axis if its inside is shown.",
    meaning="Normals, mesh and the sign of deviations may be turned round.",
    decided="Neither captures of the ball nor lines of sight nor rays say so clearly, or two of them disagree.",
    behind=(
        "merge-scans-do-not-fit", "merge-scans-in-metres", "merge-pose-reading", "merge-table-direction",
        "merge-table-steps",
    ),
)  # fmt: skip

SCATTER_OF_POSES = Code(
    "merge-pose-scatter", "note",
    text="Nobody told how far poses scatter: by the scans' overlap {position_sigma_mm:.3f} mm and "
    "{orientation_sigma_deg:.3f}° about their middle, each axis.",
    meaning="What is expected of the overlap, and how far a registration may move scans, comes from the scans.",
    decided="By restricted likelihood over the moves of all scans.",
)  # fmt: skip

NO_MESH = Code(
    "merge-no-mesh", "warning",
    text="No mesh: {why}",
    meaning="The mesh that was asked for was not made.",
    decided="By what the mesh needs: memory, points with normals, or scans with rows.",
)  # fmt: skip

NO_SELF_CALIBRATION = Code(
    "merge-no-self-calibration", "warning",
    text="No self-calibration: tool and table are given as known exactly.",
    to_do="Solve them from captures of this session, or set cell.merge.self_calibration to false.",
    meaning="What is known exactly cannot be moved by the overlap.",
    decided="`self_calibration` is asked for, and tool and table are brought with the cell.",
)  # fmt: skip

NOMINAL_NOT_FOUND = Code(
    "merge-nominal-not-found", "warning",
    text="The part is not compared with its nominal: {why}",
    meaning="Where the nominal lies in the merged cloud was not found, or its file is of no use.",
    decided="By a search over turns all over, a robust fit to the merged points, or the six datum points.",
    usual_causes="The nominal of another part, one in metres or inches, or a part of which little was scanned.",
)  # fmt: skip

NOMINAL_ALIKE = Code(
    "merge-nominal-alike", "note",
    text=Plural(
        "The nominal fits as well in {alike:d} other pose; the one nearest to the part as it lies counts.",
        "The nominal fits as well in {alike:d} other poses; the one nearest to the part as it lies counts.",
        by="alike",
    ),
    to_do="Where it matters which, tell base_from_reference (method matrix), or pick datum points.",
    meaning="The part is symmetric, or what was scanned of it is.",
    decided="Poses far apart bring the points equally near to the nominal.",
)  # fmt: skip

NOMINAL_FAR = Code(
    "merge-nominal-far", "warning",
    text="Only {percent:.0f} % of the merged points are near the nominal.",
    to_do="Check that the nominal is of this part, and where it lies.",
    meaning="Most of what was scanned is not the part, or the nominal lies elsewhere.",
    decided="Points farther off than a twentieth of the nominal's size are of other things.",
)  # fmt: skip
