"""What speaks against using an answer: the faults by name, what is said of each, and which a caller puts up with.

Faults *of the answer* are stored with it and refuse export and release.  Those *of the moment* are worked out when
somebody asks: they refuse a new release, while what is in force is still given, marked.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Final, Literal

from calib_core.errors import ConflictError, InputError
from calib_core.messages import message, sentences

Of = Literal["answer", "moment"]


class NotUsableError(ConflictError):
    """An answer that has faults which were not allowed."""


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    Attributes
    ----------
    name : str
        As `answer.faults` and `allow` have it.
    of : str
        `answer` or `moment`.
    said : str
        "this answer is …", for people at a controller, in ASCII.
    got : str
        What there is instead of a usable answer, as a phrase.
    to_do : str
        What mends it, as a sentence.
    """

    name: str
    of: Of
    said: str
    got: str
    to_do: str


_ALL: Final = (
    Fault("stale", "answer", "stale", "one whose inputs have changed", "Solve the session again."),
    Fault("fail", "answer", "failed",
        "one with the verdict 'fail'", "Mend what its result names, and solve again."),
    Fault("differs", "answer", "not what its captures give",
        "one that came from elsewhere and differs from what its captures give here", "Solve the session again."),
    Fault("altered", "answer", "of records that were changed in the database",
        "one of records that were changed or removed in the database itself, or whose key is not trusted here",
        "`scancell doctor` names them; put them right, trust their key (`scancell trust add`), or have them "
        "signed as they stand (`--accept`)."),
    Fault("not-replayed", "answer", "not replayed here",
        "one that came from elsewhere and was not solved anew here",
        "Wait for its replay, replay the session, or solve it again."),
    Fault("verify-fail", "answer", "not confirmed by its verification",
        "one whose latest verification failed its limits",
        "Look at the verification, calibrate again, and verify again."),
    Fault("drift", "moment", "of a cell that has changed",
        "one of a cell whose answers changed by more than their uncertainty",
        "Look at the cell's drift, and acknowledge it."),
    Fault("overdue", "moment", "overdue",
        "one that is older than the cell's policy allows", "Calibrate or verify the cell again."),
    Fault("equipment-changed", "moment", "of other equipment",
        "one of other equipment than the answer in force",
        "Check the serial numbers, and acknowledge the change."),
    Fault("verify-undecided", "moment", "not verified",
        "one without the verification that the cell's policy needs, or whose verification decides nothing",
        "Take captures for the verification until it decides."),
)  # fmt: skip

FAULTS: Final = {fault.name: fault for fault in _ALL}
"""All faults by name, the gravest first."""

ACKNOWLEDGED: Final = ("drift", "equipment-changed")
"""Those that somebody may acknowledge by name."""

NOT_CONFIRMED: Final = ("fail", "conditional-fail")
"""Decisions of a verification that make the fault `verify-fail`."""

OF_RESULTS: Final = ("stale", "fail")
"""Faults that a result by itself may have."""

MOST_TEXT: Final = 200
"""So long may the text of an `allow` be."""


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of faults, each once, the gravest first."""
    found = set(names)
    return tuple(name for name in FAULTS if name in found)


def allowed_faults(text: str, where: str = "allow") -> tuple[str, ...]:
    """Return the faults that a caller puts up with, from their names with commas between; raises InputError."""
    allowed = tuple(word.strip() for word in text.split(",") if word.strip())
    unknown = [word for word in allowed if word not in FAULTS]
    if unknown:
        to_do = "Write allow=stale,fail."
        raise InputError("any of {faults}", f"'{unknown[0]}'", to_do, where, faults=", ".join(FAULTS))
    return allowed


def refuse_faults(faults: Collection[str], allow: Collection[str], where: str) -> None:
    """Raise NotUsableError where an answer has faults that are not allowed; it names all of them."""
    found = [FAULTS[name] for name in in_order(faults) if name not in allow]
    if not found:
        return
    names = ",".join([*in_order(allow), *(fault.name for fault in found)])
    how = message("Or allow it (`--allow {names}`, over REST `allow={names}`): it is marked then.", names=names)
    raise NotUsableError(
        "an answer that is fresh and not failed",
        message("{all:,}", all=[fault.got for fault in found]),
        sentences([*(fault.to_do for fault in found), how]),
        where,
    )
