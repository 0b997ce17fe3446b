"""What is noticed of where results come from: signatures, replays, and what stands beside results in an archive."""

from calib_core.findings.code import Code

_SIGNED = "Results are signed with the key of the installation that solved them (`scancell trust`)."
_REPLAYED = (
    "Every stage is solved anew from the same captures; numbers must agree to a thousandth of their sigmas."
)

NOT_REPLAYED = Code(
    "not-replayed",
    "note",
    text="This result came from elsewhere, and was not solved anew here.",
    to_do="Replay the session, or solve it again.",
    meaning="Nobody whose key is trusted here has signed the result, and no replay has confirmed it yet.",
    decided=_SIGNED,
    usual_causes="An archive or folder of an earlier release, of another installation, or edited by hand.",
    fixed=True,
)

REPLAY_DIFFERS = Code(
    "replay-differs",
    "warning",
    text={
        "frames": "Solved anew here from the same captures it is another: {what} lies {sigmas:.3g} standard "
        "deviations off, and {count} values differ.",
        "values": "Solved anew here from the same captures it is another: {count} values differ, first {what}.",
    },
    to_do="Solve the session again; do not use this result.",
    by="how",
    meaning="The stored result is not what its captures give with the same revision of the method.",
    decided=_REPLAYED,
    usual_causes="The result was edited.",
    fixed=True,
)

REPLAYED_OTHER_REVISION = Code(
    "replayed-other-revision",
    "note",
    text="It was solved by revision {before} of the method; revision {now}, by which it was solved anew here, moves "
    "it by up to {sigmas:.2g} standard deviations.",
    to_do="Solve the session again for the newer method's numbers.",
    meaning="The method changed on purpose since; the result stays valid.",
    decided=_REPLAYED,
    usual_causes="A result of an earlier release.",
)

SEAL_BROKEN = Code(
    "seal-broken",
    "error",
    text="{what} is not what was signed.",
    to_do="Get it again from where it was made; do not use it.",
    meaning="A signature does not belong to what stands beside it: this was changed after it was signed.",
    decided=_SIGNED,
    usual_causes="A file was edited.",
    fixed=True,
)

NOT_SIGNED = Code(
    "not-signed",
    "note",
    text={
        "unknown": "It was signed with the key {key}, which is not trusted here.",
        "none": "Nobody has signed it.",
    },
    to_do={"unknown": "Where you know the key, add it: `scancell trust add {key}`.", "none": ""},
    by="why",
    meaning="The checksums show that nothing was damaged; they do not show who made it.",
    decided=_SIGNED,
    usual_causes="An archive of an earlier release or of another installation.",
)

ARCHIVE_DISAGREES = Code(
    "archive-disagrees",
    "error",
    text="{what} does not agree with the results in the same archive: {fields}.",
    to_do="Get the archive again from where it was made; do not use it.",
    meaning="An archive tells the same numbers in several places, and they are not the same.",
    decided="Results are compared with `answer.json`, `history.json` and what `report.html` prints: name, numbers, "
    "verdicts, decisions.",
    usual_causes="One of the files was edited.",
    fixed=True,
)
