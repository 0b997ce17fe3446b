"""Codes of several spheres in one cell: told apart, named, missing, or reflections."""

from calib_core.findings.code import Code, Plural

BALLS_NOT_TOLD_APART = Code(
    "balls-not-told-apart",
    "error",
    text="The cell tells of {count} spheres that the captures may show, and their arcs cannot be told apart.",
    to_do="Name the sphere that each capture shows as its mounting. Or capture one of them alone six times or more, with "
    "turns between, then the others; leave axes under the robot where they are meanwhile.",
    meaning="Arcs are told apart by where one scanner sees them, once it has seen one sphere often enough.",
    decided="No six arcs of a scanner come together in one place, and all of them do not fit one sphere.",
    usual_causes="Few captures of each of several spheres; an axis under the robot that moved meanwhile.",
    fixed=True,
    explains_all=True,
)

NOT_ALL_SEEN = Code(
    "spheres-not-all-seen",
    "note",
    text=Plural(
        "The captures show one sphere where the cell tells of {told}.",
        "The captures show {count} spheres where the cell tells of {told}.",
        by="count",
    ),
    to_do="Capture the others too, where their distances or places matter, or tell of those only that are there.",
    meaning="A sphere that is told is in too few captures. The answer rests on those that are seen.",
    decided="Fewer spheres of what carries them have three arcs than the cell tells of.",
    usual_causes="A sphere that is covered, out of range, or not mounted.",
)

MORE_THAN_TOLD = Code(
    "spheres-more-than-told",
    "warning",
    text=Plural(
        "The captures show {count} spheres where the cell tells of one.",
        "The captures show {count} spheres where the cell tells of {told}.",
        by="told",
    ),
    to_do="See whether one of them is a reflection of a sphere, and cover what reflects; else tell of all.",
    meaning="What is as round as a sphere stands where none is told. A mirror image that stands still counts like one.",
    decided="More spheres of what carries them have three arcs than the cell tells of.",
    usual_causes="A reflection in a polished surface, another round thing, a sphere that nobody told of.",
)

DISTANCES_NOT_USED = Code(
    "sphere-distances-not-used",
    "warning",
    text={
        "all": "The told distances of spheres are not used: they fit the places that were found in no way, or in "
        "several.",
        "one": "The told distances of spheres are not used: '{first}' and '{second}' are {found_mm:.2f} mm apart, and "
        "{told_mm:g} mm are told, which the others contradict.",
    },
    by="contradicted",
    to_do="Check the distances (centre to centre) and between which spheres each is.",
    meaning="Distances name the spheres and find a scanner's scale. Without them the answer rests on motions alone.",
    decided="No naming has all distances within 4 mm and within 4.5 standard deviations of what was found, or two "
    "that differ are equally good.",
    usual_causes="A distance between surfaces or of another pair, in inches; a plate whose distances are nearly alike.",
)

NAMED_EITHER_WAY = Code(
    "spheres-named-either-way",
    "note",
    text="Which sphere is which is not known: the told distances fit {count} ways of naming them alike.",
    meaning="The distances count all the same; only names may be exchanged.",
    decided="Namings that give the same distances to the same spheres.",
    usual_causes="A bar of two spheres, or a plate that is symmetrical.",
)

SECOND_ARC = Code(
    "capture-with-reflection",
    "warning",
    text=Plural(
        "{captures} shows another arc, more clearly than that of the sphere, where no sphere is: that of the sphere "
        "was taken.",
        "{captures} show another arc, more clearly than that of the sphere, where no sphere is: that of the sphere "
        "was taken.",
    ),
    to_do="Look for a reflection or another round thing there, and cover it.",
    meaning="A profile shows two arcs; the clearer one contradicts all other captures, and the other one fits them.",
    decided="The clearest arc lies elsewhere than those of most captures, and the capture's other arc does not.",
    usual_causes="A reflection of the sphere in a polished surface, another round thing beside it.",
)
