"""What a cell asks for before an answer is released, and the equipment that an answer was found with."""

from typing import Literal

from pydantic import Field

from calib_core.records.base import Positive, WrittenRecord


class Policy(WrittenRecord):
    """What a cell asks of an answer that is released.

    `needs`: a verification that decides.  `interval_days`: so old may the answer, or its latest verification that
    passed, be.  `four_eyes`: who captured does not release.
    """

    needs: list[Literal["verify"]] = Field(default_factory=list)
    interval_days: Positive | None = None
    four_eyes: bool = False


class EquipmentCertificate(WrittenRecord):
    """A calibration certificate: number, laboratory, dates (ISO 8601) and its file in the session."""

    number: str | None = None
    laboratory: str | None = None
    issued: str | None = None
    due: str | None = None
    file: str | None = None


class Equipment(WrittenRecord):
    """A piece of equipment by its identification; another serial number is another piece.

    `expansion_per_k` is its linear expansion, `reference_c` the temperature that its certificate is for (20 °C).
    `register_id` is its id in a server's register, which fills in what it has when the session is stored.
    """

    kind: str
    name: str | None = None
    model: str | None = None
    serial: str | None = None
    certificate: EquipmentCertificate | None = None
    expansion_per_k: Positive | None = None
    reference_c: float | None = None
    register_id: str | None = None


class Environment(WrittenRecord):
    """Temperatures in °C while it was captured."""

    ball_c: float | None = None
    air_c: float | None = None
    arm_c: float | None = None


class Excluded(WrittenRecord):
    """Who left a capture out, took it in again, added or corrected it, when (ISO 8601) and why."""

    who: str = ""
    when: str = ""
    why: str | None = None


class Removed(Excluded):
    """A capture that was taken out of its session for good: which, of which step, by whom, when and why."""

    capture: str
    step: str = ""
