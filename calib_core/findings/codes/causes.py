"""Root causes: what is at fault with a session, with the remedy that Apply makes."""

from calib_core.findings.code import Code

MOVED_SPHERE = Code(
    "moved-sphere",
    "warning",
    text={
        "before": "The sphere seems to have moved by {shift_mm:.2f} mm before {capture}.",
        "after": "The sphere seems to have moved by {shift_mm:.2f} mm after {capture}.",
    },
    to_do="Fix the sphere firmly and repeat the captures before or after that.",
    by="when",
    title="The sphere moved before {since}",
    meaning="From one capture on, the sphere stands elsewhere. Both parts fit well by themselves.",
    decided="A place of its own for the captures from there on makes all of them likelier by a factor that chance "
    "does not give, and lies at least 0.4 mm away; or the first or last captures are rejected and agree on one place.",
    usual_causes="A sphere that was touched, a stand that is loose.",
)

CHANGED_TOOL = Code(
    "changed-tool",
    "warning",
    text="The scanner seems to have moved before {since} (by {shift_mm:.2f} mm and {turn_deg:.2f}°).",
    to_do="Fix the scanner firmly and repeat the captures before or after that.",
    title="The scanner moved before {since}",
    meaning="From one capture on, the scanner sits elsewhere on what carries it.",
    decided="A tool of its own for the captures from there on makes all of them likelier by a factor that chance does "
    "not give, and differs by at least 0.4 mm or 0.05°.",
    usual_causes="A collision, a loose screw, another tool.",
)

SWAPPED_POSES = Code(
    "swapped-poses",
    "warning",
    text={
        "two-rejected": "The poses of {first} and {second} seem to be swapped.",
        "two": "The poses of {first} and {second} seem to be swapped.",
        "mixed": "The poses of {listed} seem to be mixed up: each fits that of another of these captures.",
        "two-lost": "The poses of {first} and {second} seem to be swapped. No pose fits {lost}: take it again.",
        "mixed-lost": "The poses of {listed} seem to be mixed up: each fits that of another of these captures. No pose "
        "fits {lost}: take it again.",
    },
    to_do={
        "two-rejected": "Exchange them and solve again.",
        "two": "Exchange them.",
        "mixed": "Exchange them.",
        "two-lost": "Exchange them.",
        "mixed-lost": "Exchange them.",
    },
    by="how",
    title={
        "two-rejected": "Poses of {first} and {second} are swapped",
        "two": "Poses of {first} and {second} are swapped",
        "mixed": "Poses of {listed} are mixed up",
        "two-lost": "Poses of {first} and {second} are swapped",
        "mixed-lost": "Poses of {listed} are mixed up",
    },
    meaning="Captures have each other's poses.",
    decided="Each of them fits with the other's pose, and not with its own.",
    usual_causes="Poses that were typed or sorted by hand.",
)

SHIFTED_POSES = Code(
    "shifted-poses",
    "warning",
    text={
        "before": "From {first} to {last} the captures seem to have the pose of another one: each fits that of the "
        "capture {places} before it.",
        "after": "From {first} to {last} the captures seem to have the pose of another one: each fits that of the "
        "capture {places} after it.",
        "before-lost": "From {first} to {last} the captures seem to have the pose of another one: each fits that of "
        "the capture {places} before it. No pose fits {lost}: take it again.",
        "after-lost": "From {first} to {last} the captures seem to have the pose of another one: each fits that of the "
        "capture {places} after it. No pose fits {lost}: take it again.",
    },
    by="how",
    title="Poses are shifted from {first} on",
    meaning="The list of poses is out of step with the captures.",
    decided="With the list shifted, the captures fit far better.",
    usual_causes="A capture or a pose that is missing in the list.",
)

POSE_LIST_ORDER = Code(
    "pose-list-order",
    "error",
    text={
        "names": "The list of poses seems to be in the order of names (1, 10, 11, 2): hand the poses out anew.",
        "captures": "The captures seem to be in the order of their names (1, 10, 11, 2), the poses in that of their "
        "numbers: hand the poses out anew.",
        "reversed": "The list of poses seems to be reversed: hand the poses out anew.",
        "rotated": "The list of poses seems to begin elsewhere, rotated by {places} places: hand the poses out anew.",
        "mixed": "Two lists of poses seem to be mixed, in turn or one after the other: hand the poses out anew.",
    },
    by="how",
    title="The list of poses is in a wrong order",
    meaning="Every capture has a pose of the list, but most have another one's.",
    decided="With the whole list in another order the captures fit far better.",
    usual_causes="Files sorted by name, a program that lists its points backwards, two lists put together.",
    since="0.2",
    explains_all=True,
)

POSE_READING = Code(
    "pose-reading",
    "error",
    text={
        "instead": "The captures fit together, to {after_mm:.2f} mm instead of {before_mm:.1f} mm, if the poses are "
        "{said}.",
        "alone": "The captures fit together, to {after_mm:.2f} mm, if the poses are {said}.",
    },
    to_do={"convention": "Set the cell's pose convention to '{convention}'.", "convert": "Convert them."},
    by="compared",
    by_to_do="way",
    title="Poses are {said}",
    explains_all=True,
    meaning="The poses' numbers are read in a way that does not fit the scans; another way does.",
    decided="With the other reading the sphere's centres lie less than half as far apart, in more captures than chance "
    "gives.",
    usual_causes="Another pose convention than told, metres for millimetres, radians for degrees, inverted poses.",
)

SPHERE_DIAMETER_WRONG = Code(
    "sphere-diameter",
    "error",
    text={
        "instead": "The captures fit together, to {after_mm:.2f} mm instead of {before_mm:.1f} mm, if the sphere is "
        "{diameter_mm:g} mm wide; told was {told_mm:g}.",
        "alone": "The captures fit together, to {after_mm:.2f} mm, if the sphere is {diameter_mm:g} mm wide; told was "
        "{told_mm:g}.",
        "radius": "The sphere shows in the captures if it is {diameter_mm:g} mm wide; told was {told_mm:g}: that is its "
        "radius.",
        "metres": "The sphere shows in the captures if it is {diameter_mm:g} mm wide; told was {told_mm:g}: that is in "
        "metres.",
        "inches": "The sphere shows in the captures if it is {diameter_mm:g} mm wide; told was {told_mm:g}: that is in "
        "inches.",
    },
    to_do="Measure the diameter.",
    by="compared",
    title="Sphere's diameter is about {diameter_mm:g} mm",
    explains_all=True,
    meaning="The sphere is not as large as told.",
    decided="With another diameter the sphere's centres lie less than half as far apart, or most captures show it.",
    usual_causes="A radius for a diameter, another unit, another sphere.",
)

SCALED_PROFILE = Code(
    "scaled-profile",
    "error",
    text={
        "instead": "The captures fit together, to {after_mm:.2f} mm instead of {before_mm:.1f} mm, if the scanner's "
        "files are multiplied by {factors}.",
        "alone": "The captures fit together, to {after_mm:.2f} mm, if the scanner's files are multiplied by {factors}.",
    },
    to_do="Check its calibration table and millimetres per count. Applied, points are multiplied as they are read; the "
    "answer then belongs to files that are.",
    by="compared",
    title="Profiles are scaled: {factors}",
    explains_all=True,
    meaning="The scanner's lengths are off by a factor.",
    decided="The sphere's arcs are ellipses, or with other lengths its centres lie less than half as far apart.",
    usual_causes="Another unit or count, a scanner that was not calibrated.",
)

POINTS_MIRRORED = Code(
    "points-mirrored",
    "error",
    text={
        "sphere": "The scanner's points are mirrored: the captures fit together, to {after_mm:.2f} mm instead of "
        "{before_mm:.1f} mm, if one of their axes counts the other way.",
        "scans": "The scanner's points are mirrored: the scans fit together if their {axis} counts the other way; "
        "{pairs_after:d} pairs of surfaces lie together then, {pairs_before:d} do now.",
    },
    to_do="Have its program write a right-handed frame. Applied, {axis} is read with the other sign; the answer then "
    "belongs to points that are.",
    by="of",
    title="Points are mirrored: {axis} × −1",
    explains_all=True,
    meaning="The frame of the clouds or centres is left-handed, as in a mirror: no tool brings them together.",
    decided="With one axis turned round the sphere's centres lie less than half as far apart, or far more pairs of "
    "surfaces of scans lie together.",
    usual_causes="Rows counted from the other end, an image's y that points down, a program with a left-handed frame.",
)

POINT_UNIT = Code(
    "point-unit",
    "error",
    text={
        "m": "The sphere shows in the captures if the numbers in their files are metres.",
        "cm": "The sphere shows in the captures if the numbers in their files are centimetres.",
        "in": "The sphere shows in the captures if the numbers in their files are inches.",
        "um": "The sphere shows in the captures if the numbers in their files are micrometres.",
    },
    to_do="Say so in the captures' format_settings.",
    by="unit",
    title={
        "m": "Files are in metres",
        "cm": "Files are in centimetres",
        "in": "Files are in inches",
        "um": "Files are in micrometres",
    },
    explains_all=True,
    meaning="The files of points are in another unit.",
    decided="In the other unit most captures show the sphere.",
    usual_causes="A file whose format does not say its unit.",
)

TABLE_DIRECTION = Code(
    "table-direction",
    "warning",
    text={
        "right": "The table turns the other way round than turntable.direction = {told} says: its angles count "
        "right-handed about the axis that points up.",
        "left": "The table turns the other way round than turntable.direction = {told} says: its angles count "
        "left-handed about the axis that points up.",
        "right of several": "The axis {axis} turns the other way round than its direction = {told} says: its angles count "
        "right-handed about the end that points up.",
        "left of several": "The axis {axis} turns the other way round than its direction = {told} says: its angles count "
        "left-handed about the end that points up.",
    },
    to_do="The answer has direction {direction}; correct the cell.",
    by="counts",
    title="The table turns the other way round",
    meaning="The sense in which the table's angles count is not the one that was told.",
    decided="With the direction told, the table's axis would point down.",
    usual_causes="A sign of the table's controller.",
)

TABLE_ANGLES = Code(
    "table-angles",
    "warning",
    text={
        "radians": "The captures on the table fit, to {after_mm:.2f} mm, if the table's angles are in radians.",
        "gon": "The captures on the table fit, to {after_mm:.2f} mm, if the table's angles are in gon.",
        "turns": "The captures on the table fit, to {after_mm:.2f} mm, if the table's angles are in turns.",
        "minutes of arc": "The captures on the table fit, to {after_mm:.2f} mm, if the table's angles are in minutes of "
        "arc.",
        "factor": "The captures on the table fit, to {after_mm:.2f} mm, if the table's angles are {factor:.4g} times as "
        "large as told.",
        "step": "The captures on the table fit, to {after_mm:.2f} mm, if the table's angles are off by "
        "{offset_deg:+g}° from {since} on.",
    },
    to_do="Convert them.",
    by="unit",
    title={
        "radians": "Table angles are in radians",
        "gon": "Table angles are in gon",
        "turns": "Table angles are in turns",
        "minutes of arc": "Table angles are in minutes of arc",
        "factor": "Table angles are {factor:.4g} times as large as told",
        "step": "Table angles are off by {offset_deg:+g}° from {since} on",
    },
    meaning="The table's angles are not in degrees, in steps of another size, or a step was lost.",
    decided="With the other angles the sphere lies less than half as far off its circle.",
    usual_causes="Another unit, a gear ratio, a table that slipped.",
)
