"""The report's own texts: English, as the catalogues translate them."""

from typing import Final

from calib_core.messages import templates

WORDS: Final = templates({
    "title": "Calibration report",
    "number": "Report number",
    "page": "Page {page} of {pages}",
    "subject": "What was calibrated",
    "scanner": "Scanner",
    "robot": "Robot",
    "cell": "Cell",
    "captured": "Captured",
    "clock_file": "dates of the files",
    "clock_server": "the server's clock",
    "clock_device": "the device's clock",
    "clock_program": "told by the program that sent them",
    "clock_received": "when the server received them",
    "solved": "Solved",
    "date unsigned": "{moment}, as told: nobody who is trusted here has signed this date",
    "captures": "Captures",
    "operator": "Operator",
    "place": "Place",
    "procedure": "Procedure",
    "customer": "Customer",
    "received": "Item received",
    "replaces": "Replaces report",
    "amended": "This report replaces report {number}. Reason: {why}",
    "result": "Result",
    "judged": "Verdict of the calibration",
    "expanded": "Expanded uncertainty of the calibration (k = 2, about 95 %). The robot's own error at each pose "
    "comes on top.",
    "wanted": "Wanted at the workpiece",
    "simulated": "A simulated cell: its truth stands beside each result.",
    "nothing": "Nothing is solved yet.",
    "decision": "Decision",
    "figure": "Figure",
    "measured": "Measured (± at k = 2)",
    "limit": "Limit",
    "not limited": "not limited",
    "rule": "Decision rule: ISO 14253-1 with the expanded uncertainty U (k = 2) as guard band. Pass: up to the "
    "limit less U. Conditional pass: up to the limit. Conditional fail: up to the limit plus U. Fail: beyond. "
    "Undecided: U is above the limit, or too few captures count.",
    "no verification": "There is no verification: figures with their uncertainty are stated, and no conformity.",
    "no limits": "No limits were set for the verification: figures with their uncertainty are stated, and no "
    "conformity.",
    "approval": "Approval",
    "not released": "No release of this answer is known here.",
    "in spite of": "It was released in spite of this: {faults}",
    "name": "Name",
    "date": "Date",
    "signature": "Signature",
    "calibrated by": "Calibrated by",
    "checked by": "Checked by",
    "approved by": "Approved by",
    "evidence": "Evidence",
    "finds": "SHA-256 of what the answer was computed from. It finds the session in the workbench's search, and "
    "“scancell archive verify” prints it of an archive.",
    "equipment": "Equipment and traceability",
    "kind": "Kind",
    "piece": "Identification",
    "serial": "Serial number",
    "certificate": "Certificate",
    "laboratory": "Laboratory",
    "issued": "Issued",
    "due": "Due",
    "overdue": "{due}, overdue when captured",
    "certificate file": "Certificate's file, in the session's archive below data/",
    "no file": "not kept with the session",
    "no equipment": "No equipment was told: traceability is not stated.",
    "environment": "Environment",
    "where": "Where",
    "ball": "Sphere, °C",
    "air": "Air, °C",
    "arm": "Arm, °C",
    "session": "Whole session",
    "no environment": "No temperatures were told: lengths are taken as they are at the temperature of their "
    "certificates.",
    "documentation": "Documentation",
    "order": "Order",
    "order_number": "Order number",
    "project": "Project",
    "remarks": "Remarks",
    "cell data": "Cell data",
    "picture": "The cell in base: sphere, and the scanner at each capture. Blue: used. Red: left out. "
    "Grey: not judged.",
    "results": "Results",
    "software": "Software",
    "inputs": "SHA-256 of the inputs",
    "out of date": "out of date",
    "statements": "Statements",
    "recompute": "“scancell archive replay” recomputes every number from the session's archive: the same captures "
    "give the same numbers, bit for bit on one machine, and within 10⁻⁶ of the stated standard deviations with "
    "other processors' linear algebra and thread counts.",
    "in full": "The results relate to the items named and the time of the captures only. Copies only of the whole "
    "report.",
})  # fmt: skip
"""What stands between the records' own texts."""

OFTEN_TOLD: Final = ("order", "order_number", "project", "remarks")
"""Lines of `documentation` that have words here; others are said as they were told."""

KINDS: Final = templates({
    "sphere": "Sphere",
    "bar": "Ball bar",
    "plate": "Flat plate",
    "scanner": "Scanner",
    "robot": "Robot",
    "table": "Turntable",
    "profile": "Profile scanner",
    "sweep": "Profile scanner",
    "cloud": "Area scanner",
    "frame": "Camera with a laser line",
    "center": "Sphere centres",
    "chessboard": "Chessboard",
    "charuco": "ChArUco board",
    "circles": "Grid of circles",
    "asymmetric-circles": "Grid of staggered circles",
    "away": "away from the scanner",
    "toward": "towards the scanner",
})  # fmt: skip
"""Of equipment, scanners, boards and axes; others are said as they were told."""
