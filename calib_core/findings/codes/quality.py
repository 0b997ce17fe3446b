"""What is noticed in one capture as soon as it comes in: is the object seen, and how well."""

from calib_core.findings.code import Code, Plural

NOT_SEEN = Code(
    "capture-shows-nothing",
    "error",
    text="Need {need}, got {got}.",
    to_do="{to_do}",
    meaning="What is to be measured cannot be found in the capture, or does not fit. The capture is kept.",
    decided="The measuring of the capture says what it needs and what it found.",
    usual_causes="A sphere or board out of view, glare, another exposure, another file.",
    fixed=True,
)

FILE_DOUBTFUL = Code(
    "file-doubtful",
    "warning",
    text={
        "told": "The file is doubtful: {doubt}",
        "read": "{captures}: the file is doubtful: {doubt} Taken: {reading}.",
    },
    by="shown",
    to_do="Look at what was read; say otherwise in the capture's format and format_settings.",
    meaning="The file could be read, but something in it speaks for another reading.",
    decided="The reader of its format says what it doubts.",
    usual_causes="Points in metres without a unit, zeros that stand for what did not come back.",
)

STRIPE_IN_MIDDLE = Code(
    "stripe-through-middle",
    "warning",
    text="The stripe runs almost through the sphere's middle (r/R = {zone:.3f}): the circle barely changes there when "
    "the sphere moves across the stripe.",
    to_do="Move the stripe about {step_mm:.0f} mm off the sphere's middle, square to the stripe.",
    meaning="Where the stripe crosses the middle, the circle's radius says little of where the sphere's centre is.",
    decided="The circle's radius is more than 0.95 of the sphere's.",
    usual_causes="A stripe that was aimed at the middle.",
)

STRIPE_GRAZES = Code(
    "stripe-grazes-sphere",
    "warning",
    text="The stripe only grazes the sphere (r/R = {zone:.2f}).",
    to_do="Move the stripe about {step_mm:.0f} mm towards the sphere's middle, square to the stripe.",
    meaning="A short arc near the sphere's edge fixes its centre badly.",
    decided="The circle's radius is less than 0.45 of the sphere's.",
    usual_causes="A sphere at the edge of the stripe's plane.",
)

ARC_SHORT = Code(
    "arc-short",
    "warning",
    text="Only {extent_deg:.0f}° of the arc are seen, 110° and more are good.",
    to_do={
        "minus": "The sphere leaves the stripe at its −x end: move {move_mm:.0f} mm to −x.",
        "plus": "The sphere leaves the stripe at its +x end: move {move_mm:.0f} mm to +x.",
        "covered": "Move the whole sphere into the measuring range, and keep other things out of its way.",
    },
    by_to_do="end",
    meaning="A short arc leaves its circle's centre and radius uncertain.",
    decided="Less than 70° of the circle are seen.",
    usual_causes="A sphere at the end of the stripe, or something before it.",
)

NOT_STILL = Code(
    "capture-not-still",
    "warning",
    text="The sphere moved by {movement_mm:.3f} mm between {exposures} exposures at one commanded pose, where noise alone "
    "lets it scatter {noise_mm:.3f} mm.",
    to_do="Let the arm settle before the capture, and fix what shakes: scanner, sphere or stand.",
    meaning="Something moved while the capture was taken at rest.",
    decided="Chance gives such a movement in fewer than one of a hundred captures.",
    usual_causes="An arm that swings after its stop, a stand that shakes.",
)

_PROFILES = {
    "all": "{arcs} of {profiles} profiles show the sphere's arc.",
    "thinned": "{arcs} of {profiles} profiles show the sphere's arc; {most} of them, evenly spread, are used.",
}

FEW_PROFILES = Code(
    "sweep-few-profiles",
    "warning",
    text=_PROFILES,
    by="used",
    to_do="Move more slowly across the sphere, or record more profiles.",
    meaning="A sweep that crosses the sphere in few profiles says little more than one of them.",
    decided="Fewer than 5 profiles show the arc, and they do not all stand at one pose.",
    usual_causes="A sweep that is too fast, or passes beside the sphere.",
)

SWEEP_PROFILES = Code(
    "sweep-profiles",
    "note",
    text=_PROFILES,
    by="used",
    meaning="Every profile in which the arc is found is an observation of its own.",
    decided="The arc is looked for in each profile.",
)

SWEEP_OF_OBJECT = Code(
    "sweep-of-object",
    "note",
    text=Plural("{count} profile.", "{count} profiles.", by="count"),
    meaning="A sweep over an object is merged later; nothing is looked for in it.",
    decided="The step of the capture shows no sphere.",
)

SWEEP_EMPTY = Code(
    "sweep-empty",
    "error",
    text="Nothing came back to the scanner in any profile.",
    to_do="Check distance and exposure, and take the sweep again.",
    meaning="The sweep holds no points.",
    decided="No profile has a point.",
    usual_causes="An object out of the measuring range, a laser that was off.",
    fixed=True,
)

EDGES_SOFT = Code(
    "board-edges-soft",
    "warning",
    text="The board's edges are {width_px:.0f} pixels wide.",
    to_do="Focus the camera or hold it still.",
    meaning="Corners between blurred edges are found less precisely.",
    decided="The edges rise from 10 to 90 % over more than 6 px.",
    usual_causes="A lens out of focus, motion during the exposure.",
)

BOARD_SATURATED = Code(
    "board-saturated",
    "warning",
    text="{share:.0%} of the board is saturated.",
    to_do="Shorten the exposure or dim the lamps.",
    meaning="White that bleeds into black moves the corners.",
    decided="More than a quarter of the board has the largest grey value.",
    usual_causes="A long exposure, a lamp that is reflected.",
)

IN_COLOUR = Code(
    "frame-in-colour",
    "note",
    text="The frame is in colour and was turned into grey.",
    meaning="A camera that interpolates colours between pixels blurs the corners a little.",
    decided="The file has three channels.",
)

CORNERS_COVERED = Code(
    "board-corners-covered",
    "note",
    text=Plural(
        "{count} corner was left out: glare, dirt or something over it.",
        "{count} corners were left out: glare, dirt or something over them.",
        by="count",
    ),
    meaning="Corners that do not look like corners do not count.",
    decided="The picture around a corner does not fit two edges that cross.",
)

BOARD_IN_PART = Code(
    "board-in-part",
    "note",
    text={
        "known": "{seen} of {count} corners are seen; which ones, rows, columns and edges tell.",
        "open": "{seen} of {count} corners are seen, and nothing tells which ones: the frame counts for the camera, "
        "not for the board's place.",
    },
    by="place",
    meaning="A part of the board lies outside the frame or is covered; what is seen of it counts.",
    decided="Rows and columns are counted, sides where the squares end on the margin are looked for, and the squares' "
    "colours compared; the board can lie in one place alone, or in several.",
)

WAITS_FOR_CAMERA = Code(
    "frame-waits-for-calibration",
    "warning",
    text="The stripe is seen, but camera and plane of light are not known yet: it cannot become points.",
    to_do="Solve the laser plane; this capture is then measured by itself.",
    meaning="A raw frame becomes points by the camera and the plane of light.",
    decided="Neither are told with the cell nor solved yet.",
    usual_causes="Captures of the sphere that were taken before the laser plane was solved.",
)

LIGHT_PLANE_OUTDATED = Code(
    "light-plane-outdated",
    "warning",
    text="It is measured with the plane of light as it was solved before its captures changed.",
    to_do="Solve the laser plane again; this capture is then measured again.",
    meaning="The frame was made points with an outdated plane of light.",
    decided="The stage of the plane of light is stale.",
    usual_causes="Boards that were added, removed or corrected after the solve.",
)

WAITS_FOR_MEASURING = Code(
    "capture-waits",
    "warning",
    text={
        "batch": "It is not measured yet: it came with many others.",
        "cell": "It is measured again: the cell has changed.",
        "record": "It is measured again: it or the cell has changed.",
    },
    by="since",
    to_do="Wait a moment; nothing has to be sent again.",
    meaning="The capture is stored; it is measured in its turn.",
    decided="It is in the queue of captures to be measured.",
    usual_causes="A batch of captures that came at once, a change of the cell.",
    fixed=True,
)

NOT_FINITE = Code(
    "capture-not-finite",
    "error",
    text="What is measured in it has no finite size.",
    to_do="Check the numbers in its file: some are far too large.",
    meaning="The numbers of the file are beyond what can be computed with.",
    decided="A figure of the capture is infinite or no number.",
    usual_causes="A value that stands for a missing point, such as 1e30.",
    fixed=True,
)

MEASURING_FAILED = Code(
    "measuring-failed",
    "error",
    text={
        "program": "Measuring it failed by an error of the program itself ({error}).",
        "process": "The process that measured it ended (a library failed, or memory ran out).",
        "time": "Measuring it took longer than {limit_s:g} s.",
    },
    to_do={
        "program": "The capture is kept; report this with its file.",
        "process": "The capture is kept; report this with its file.",
        "time": "The capture is kept; send less at once: thin or crop it.",
    },
    by="how",
    meaning="The program could not measure the capture; that is no fault of yours.",
    decided="The measuring ended without an answer.",
    fixed=True,
)

FILES_REMOVED = Code(
    "capture-files-removed",
    "warning",
    text="Its files were removed since.",
    meaning="The capture stands in the session's past; its files are gone.",
    decided="The capture was removed after the moment that is shown.",
    fixed=True,
)
