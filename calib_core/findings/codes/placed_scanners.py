"""Where scanners are that other captures than those of step tcp must place, and what nobody checks of it."""

from calib_core.findings.code import Code

TABLE_WITHOUT_BASE = Code(
    "table-without-base",
    "note",
    text="Scanner and table are determined to each other, not in the robot's base: the scanner saw no sphere on the "
    "flange.",
    to_do="Where the base matters, capture a sphere on the flange with step 'tcp'.",
    meaning="Nothing that the robot carries was seen by the scanner that stands still before the table. Scans on the "
    "table are merged rightly all the same; what lies in base has no number.",
    decided="Every scanner with captures on the table stands still, and none of them has captures of step tcp.",
    usual_causes="A cell without a robot.",
    fixed=True,
)

SCANNER_LEFT_TO_CHAIN = Code(
    "scanner-left-to-chain",
    "note",
    text="The scanner '{scanner}' has captures on the table alone: the stage chain finds where it is.",
    reason="by '{scanner}', which the stage chain places",
    meaning="A scanner that never saw the still sphere is placed by the sphere on the table, which others saw too. The "
    "stage turntable goes by scanners that were placed before.",
    decided="The scanner has captures on the table and none with step tcp.",
    usual_causes="A scanner that only sees the table.",
)

SCANNER_NOT_PLACED = Code(
    "scanner-not-placed",
    "warning",
    text={
        "nothing-common": "Not determined: where the scanner '{scanner}' is. It saw no mounting of the sphere that another scanner saw.",
        "one-height": "Not determined: where the scanner '{scanner}' is. All spheres that it shares with others move in one plane: "
        "it may be mirrored at it.",
        "no-agreement": "Its captures bring the scanner '{scanner}' to no one place.",
        "not-in-answer": "The answer does not say where the scanner '{scanner}' is: it verifies nothing.",
        "no-scans": "Not merged: {captures}. Nothing says where the scanner '{scanner}' is.",
    },
    to_do={
        "nothing-common": "Capture one mounting of the sphere with both scanners, at four angles or more.",
        "one-height": "Capture with it a second mounting, 20 mm higher or lower, that the other scanner sees too.",
        "no-agreement": "Check its captures' table angles, mountings and scanner.",
        "not-in-answer": "Calibrate with this scanner, too.",
        "no-scans": "Capture the sphere with this scanner, too, or exclude its scans.",
    },
    reason="by '{scanner}', whose place is not determined",
    by="why",
    by_to_do="why",
    meaning="A scanner without captures of step tcp is placed by spheres on the table whose places others tell.",
    decided="Fewer than four captures of such mountings; or another place whose median misfit is below 3 × that of the "
    "best + 0.3 mm; or a median misfit above 5 mm.",
    usual_causes="Mountings that only this scanner saw, one height.",
)

SCANNER_MOVE_NOT_CHECKED = Code(
    "scanner-move-not-checked",
    "note",
    text="Not checked: whether the scanner, which stands still, moved between the captures of the sphere on the flange and "
    "those of the table.",
    to_do="Capture the sphere on the flange from three poses more after those of the table.",
    meaning="Captures of the sphere on the table do not tell where a scanner that stands still is in base. If it moved after "
    "those of the sphere on the flange, the table's frame in base is off by as much; what is merged by this scanner is not.",
    decided="Captures of the sphere on the flange come before those of the table or after them, not both.",
)
