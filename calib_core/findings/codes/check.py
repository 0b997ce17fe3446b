"""What a check notices in a session before it is solved: what is wrong, and what is missing."""

from calib_core.findings.code import Code, Plural

NOT_USABLE = Code(
    "input-not-usable",
    "error",
    text="Need {need}, got {got}.",
    to_do="{to_do}",
    meaning="A field of the session or a file cannot be used as it is: solving would refuse it.",
    decided="It is read as solving reads it.",
    usual_causes="A file that is cut off, a field that is missing.",
    fixed=True,
)

UNKNOWN_FIELD = Code(
    "unknown-field",
    "warning",
    text="The field '{field}' is unknown and has no effect: is it a typing error?",
    to_do="Correct its name, or remove it.",
    meaning="The format has no field of this name.",
    decided="The field is not among those of the record.",
    usual_causes="A typing error, a field of another program.",
)

NO_SPHERE_CAPTURES = Code(
    "no-tcp-captures",
    "error",
    text="There is no capture with step 'tcp' yet.",
    to_do="Capture the sphere.",
    meaning="Nothing shows where the scanner is on the flange, and what was captured rests on it.",
    decided="No capture has the step 'tcp', and the tool was not brought.",
    usual_causes="A session that has just begun.",
    fixed=True,
)

NO_SPHERE_CAPTURES_YET = Code(
    "no-tcp-captures-yet",
    "note",
    text="There is no capture with step 'tcp' yet.",
    to_do="Capture the sphere.",
    meaning="Nothing shows where the scanner is on the flange; what was captured does not rest on it.",
    decided="No capture has the step 'tcp', and only boards were captured.",
)

STAGE_BROUGHT = Code(
    "stage-brought",
    "note",
    text="Given, so that the stage {stage} is not solved: {fields}.",
    meaning="The result was brought with the cell (cell.known).",
    decided="The field of cell.known is filled.",
)

DIAMETER_SIGMA_ASSUMED = Code(
    "sphere-sigma-assumed",
    "note",
    text="The uncertainty of the sphere's diameter is left out: {sigma_mm:g} mm is assumed, as of its class.",
    meaning="The sphere's diameter is never exact; its uncertainty is part of every answer.",
    decided="`cell.sphere_diameter_sigma_mm` is left out; the class is `cell.sphere_class`.",
)

TOO_FEW_CAPTURES = Code(
    "captures-too-few",
    "error",
    text="Captures that can be used: {count}. At least {least} are needed.",
    to_do="{to_do}",
    meaning="The stage cannot be solved from so few captures.",
    decided="The captures in which something is seen are counted.",
    usual_causes="A session that is not finished, captures that do not show the object.",
    fixed=True,
)

BLIND_CAPTURES = Code(
    "captures-show-nothing",
    "warning",
    text=Plural("{captures}: {why}", "{captures} (numbers of {first}): {why}"),
    to_do="{to_do}",
    meaning="What is to be measured cannot be found in the captures: they are kept, but not used.",
    decided="What is measured in each capture says what it needs and what it found.",
    usual_causes="A sphere or board out of view, glare, another exposure, another file.",
)

WEAK_CAPTURES = Code(
    "captures-weak",
    "note",
    text=Plural("{captures}: {why}", "{captures} (numbers of {first}): {why}"),
    to_do="{to_do}",
    meaning="The captures are used; others of their kind would tell more.",
    decided="What is measured in each capture says how good it is.",
    usual_causes="A stripe that lies badly on the sphere.",
)

FILE_REPEATED = Code(
    "capture-file-repeated",
    "warning",
    text=Plural(
        "The file of {captures} is that of {original}, byte for byte, but its pose is another: one of the two is a copy.",
        "The files of {captures} are those of others ({original} is the first's), byte for byte, but their poses are not: "
        "one of each two is a copy.",
    ),
    to_do="Give it its own file, or remove it.",
    meaning="A measurement never repeats byte for byte: a file was stored twice.",
    decided="The files are equal, the poses are not.",
    usual_causes="A file that was picked for the wrong capture.",
)

ANGLES_IN_RADIANS = Code(
    "angles-look-like-radians",
    "warning",
    text="All angles are below 3.15: they look like radians.",
    to_do="If they are, convert them to degrees.",
    meaning="Angles of a pose are read in degrees unless the convention says otherwise.",
    decided="No angle of any pose is above π.",
    usual_causes="Poses that were printed by a program.",
)

COLUMNS_SWAPPED = Code(
    "pose-columns-swapped",
    "warning",
    text="The poses look at one place within {spread_mm:.3g} mm if their numbers stand in the order {order}, and within "
    "{told_spread_mm:.3g} mm as they are: are columns swapped?",
    to_do="Compare one pose with the pendant.",
    meaning="Captures of one sphere look at one place; another order of the numbers makes them do so far better.",
    decided="All orders of the columns are tried.",
    usual_causes="A table whose columns were typed in another order.",
)

CONVENTION_LIKELY = Code(
    "pose-convention-likely",
    "warning",
    text={
        "differs": "The poses look at one place within {spread_mm:.3g} mm if they are written as '{likely}', and within "
        "{told_spread_mm:.3g} mm as '{told}'.",
        "unread": "The poses look at one place within {spread_mm:.3g} mm if they are written as '{likely}', and cannot be "
        "read as '{told}'.",
    },
    by="as_told",
    to_do="Compare one pose with the pendant.",
    meaning="Captures of one sphere look at one place; another convention makes them do so far better.",
    decided="All conventions are tried.",
    usual_causes="A convention that was not told, or is that of another controller.",
)

TOO_FEW_TILTS = Code(
    "tilts-too-few",
    "warning",
    text=Plural(
        "The flange was tilted {count} time; at least {least} tilts of 10 to 30° about axes that are not parallel are "
        "needed: they fix the scanner's position.",
        "The flange was tilted {count} times; at least {least} tilts of 10 to 30° about axes that are not parallel are "
        "needed: they fix the scanner's position.",
        by="count",
    ),
    to_do="Tilt the flange, if the machine can, and capture the sphere again.",
    meaning="Poses of one orientation leave the scanner's place on the flange open.",
    decided="Orientations that differ by 5° or more are counted.",
    usual_causes="A robot that was only shifted, or a machine of few axes, which cannot tilt.",
    fixed=True,
)

FEW_SHIFTS = Code(
    "shifts-few",
    "note",
    text=Plural(
        "There is {count} shift without turning; {least} that are not parallel let the paper's two steps be computed "
        "beside the joint answer.",
        "There are {count} shifts without turning; {least} that are not parallel let the paper's two steps be computed "
        "beside the joint answer.",
        by="count",
    ),
    meaning="The joint answer does not need shifts; the two steps of the paper do.",
    decided="Captures with one orientation are counted.",
)

CAPTURES_COUNTED = Code(
    "captures-counted",
    "note",
    text="{count} captures, {shifts} shifts and {tilts} tilts.",
    meaning="What the captures of the sphere are, as the solver sees them.",
    decided="By the poses.",
)
