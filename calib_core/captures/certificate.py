"""A digital calibration certificate (DCC): whose it is, its expansion, and a sphere's diameter with uncertainty.

The XML of PTB's Digital Calibration Certificate with quantities in D-SI: `si:value`, `si:unit`, the expanded
uncertainty with its coverage factor, in the words of D-SI 1 (`expandedUnc`) and of D-SI 2
(`measurementUncertaintyUnivariate`).
"""

import math
import re
from collections.abc import Sequence
from datetime import date

from calib_core.errors import CalibrationError, InputError
from calib_core.findings.codes.circumstances import CERTIFICATE_FILE, CERTIFICATE_OVERDUE
from calib_core.formats.shared.xml_file import Element, elements
from calib_core.messages import message, plural
from calib_core.records import Finding, ReadFile, Record, Session
from calib_core.records.policy import Equipment, EquipmentCertificate

_DATE = len("2026-11-03")

_MM = {"metre": 1000.0, "m": 1000.0, "mm": 1.0, "um": 1e-3, "µm": 1e-3}
_PREFIXES = {"milli": 1e-3, "micro": 1e-6, "centi": 1e-2, "deci": 1e-1, "nano": 1e-9, "kilo": 1e3}
_DIAMETER = re.compile(r"diamet|durchmesser|diamètre|diámetro|直径|直徑", re.IGNORECASE)
_EXPANSION = re.compile(r"expansion|ausdehnung|dilata|膨胀|膨脹", re.IGNORECASE)
_REFERENCE = re.compile(
    r"(reference|referenz|bezugs|standard)\W*temperatur|参考温度|標準溫度|标准温度|referenceTemperature",
    re.IGNORECASE,
)
_KELVINS = (r"\kelvin\tothe{-1}", r"\per\kelvin")
_METRES = (r"\micro\metre\metre\tothe{-1}\kelvin\tothe{-1}", r"\micro\metre\per\metre\per\kelvin")
_PER_K = {
    **dict.fromkeys((*_KELVINS, "1/K", "K^-1"), 1.0),
    **dict.fromkeys((*_METRES, *(rf"\micro{one}" for one in _KELVINS)), 1e-6),
}
_ZERO_C = {r"\degreecelsius": 0.0, "°C": 0.0, r"\kelvin": -273.15, "K": -273.15}
_EXPANDED = ("uncertainty", "valueExpandedMU")
_FACTORS = ("coverageFactor",)
_STANDARD = ("valueStandardMU",)
_LARGEST_BYTES = 20_000_000


class CertifiedDiameter(Record):
    """One diameter of a certificate; `sigma_mm` is its standard uncertainty, None where none stands there."""

    name: str
    diameter_mm: float
    sigma_mm: float | None
    coverage_factor: float | None
    line: int


class Certificate(Record):
    """What a certificate tells: its number, its diameters, and whose it is, as `cell.equipment` takes it."""

    identifier: str
    diameters: list[CertifiedDiameter]
    equipment: Equipment


def read_certificate(data: bytes, where: str = "certificate", *, of_sphere: bool = True) -> Certificate:
    """Return what a digital calibration certificate tells.

    Raises
    ------
    InputError
        If it is no whole XML, declares entities, is no DCC, or, `of_sphere`, has no diameter in a unit of length.
    """
    if len(data) > _LARGEST_BYTES:
        need = "a file of at most {limit_mb:g} MB"
        to_do = "Give the XML alone."
        got = plural("{count} byte", "{count} bytes", by="count", count=len(data))
        raise InputError(need, got, to_do, where, limit_mb=_LARGEST_BYTES / 1e6)
    found = elements(data, where)
    if not found or found[0].name != "digitalCalibrationCertificate":
        got = f"<{found[0].name}>" if found else message("nothing")
        to_do = message("Give the XML file of the certificate; of a PDF it is an attachment.")
        raise InputError("a digital calibration certificate (DCC)", got, to_do, where)
    numbers = [e.text.strip() for e in found if e.name == "uniqueIdentifier"]
    reals = [e for e in found if e.name == "real"]
    diameters = [one for real in reals if (one := _diameter(real, found, where)) is not None]
    if not diameters and of_sphere:
        to_do = message("Type the diameter and its standard uncertainty instead.")
        need = "a diameter in a unit of length"
        raise InputError(need, "{count} other quantities", to_do, where, count=len(reals))
    equipment = _equipment(found, next(iter(numbers), ""), "sphere" if diameters else "")
    equipment = equipment.model_copy(update=_expansion(reals, found, where))
    return Certificate(identifier=next(iter(numbers), ""), diameters=diameters, equipment=equipment)


def certificate_findings(session: Session, read: ReadFile) -> list[Finding]:
    """Return a warning for each certificate whose file is not in the session, or is another piece's."""
    pieces = [one for one in session.cell.equipment or () if one.certificate and one.certificate.file]
    return [finding for one in pieces if (finding := _file_finding(one, read)) is not None]


def _file_finding(one: Equipment, read: ReadFile) -> Finding | None:
    told = one.certificate or EquipmentCertificate()
    file, piece = told.file or "", piece_words(one)
    try:
        content = read(file)
    except (CalibrationError, LookupError, OSError):
        return CERTIFICATE_FILE(where="cell.equipment", what="missing", piece=piece, file=file)
    if not content.lstrip().startswith(b"<"):
        return None
    try:
        item = read_certificate(content, file, of_sphere=False).equipment
    except InputError:
        return None
    pairs = [(item.certificate and item.certificate.number, told.number), (item.serial, one.serial)]
    for found, expected in pairs:
        if found and expected and found != expected:
            return CERTIFICATE_FILE(
                where="cell.equipment", what="differs", piece=piece, file=file, found=found, told=expected
            )
    return None


def _equipment(every: Sequence[Element], number: str, kind: str) -> Equipment:
    """Return a certificate's item, its laboratory, and the day of issue, else the last one of measuring."""
    laboratory = _within(every, "calibrationLaboratory", "name", "content")
    issued = _within(every, "coreData", "issueDate") or _within(every, "coreData", "endPerformanceDate")
    certificate = EquipmentCertificate(number=number or None, laboratory=laboratory, issued=issued)
    return Equipment(
        kind=kind,
        name=_within(every, "item", "name", "content"),
        model=_within(every, "item", "model"),
        serial=_serial(every),
        certificate=certificate,
    )


def _expansion(reals: Sequence[Element], every: Sequence[Element], where: str) -> dict[str, float]:
    """Return an item's expansion and the temperature that its certificate is for, as far as they stand there."""
    told: dict[str, float] = {}
    for real in reals:
        words, own = _told(real, every)
        unit = "".join(own["unit"].text.split()) if "unit" in own else ""
        if "value" not in own:
            continue
        if _EXPANSION.search(words) and unit in _PER_K:
            per_k = _number(own["value"], where) * _PER_K[unit]
            if per_k > 0:
                told.setdefault("expansion_per_k", float(f"{per_k:.6g}"))
        elif _REFERENCE.search(words) and unit in _ZERO_C:
            told.setdefault("reference_c", round(_number(own["value"], where) + _ZERO_C[unit], 6))
    return told


def _within(every: Sequence[Element], *path: str) -> str | None:
    """Return the text of the first element that stands within others by their names, the outermost first."""
    *around, name = path
    found = (one for one in every if one.name == name and [p.name for p in one.path if p.name in around] == around)
    return next((text[:200] for one in found if (text := " ".join(one.text.split()))), None)


def _serial(every: Sequence[Element]) -> str | None:
    """Return the item's serial number: the identification that the manufacturer gave, else the first one."""
    given = [e for e in every if e.name == "identification" and any(p.name == "item" for p in e.path)]
    told = [{e.name: " ".join(e.text.split()) for e in every if e.path and e.path[-1] is one} for one in given]
    best = sorted(told, key=lambda one: one.get("issuer") != "manufacturer")
    return next((one["value"][:200] for one in best if one.get("value")), None)


def _told(real: Element, every: Sequence[Element]) -> tuple[str, dict[str, Element]]:
    """Return all words of a quantity, its name first, and the elements of its number by their names."""
    own = {e.name: e for e in every if e.path and e.path[-1] is real}
    around = [e for e in reversed(real.path) if e.name in ("quantity", "influenceCondition")]
    words = [word for e in around for word in (_name(e, every), e.attributes.get("refType", "")) if word]
    return "\n".join([*words, *([own["label"].text] if "label" in own else [])]), own


def _diameter(real: Element, every: Sequence[Element], where: str) -> CertifiedDiameter | None:
    words, own = _told(real, every)
    factor = _factor(own["unit"].text) if "unit" in own else None
    if factor is None or "value" not in own or not _DIAMETER.search(words):
        return None
    inside = [e for e in every if any(parent is real for parent in e.path)]
    value = _number(own["value"], where) * factor
    if value <= 0:
        to_do = "Look at the certificate."
        raise InputError("a positive diameter in mm", "{value:g} mm", to_do, _at(real, where), value=value)
    sigma, coverage = _sigma(inside, where)
    return CertifiedDiameter(
        name=words.partition("\n")[0],
        diameter_mm=round(value, 9),
        sigma_mm=None if sigma is None else round(sigma * factor, 9),
        coverage_factor=coverage,
        line=real.line,
    )


def _sigma(inside: Sequence[Element], where: str) -> tuple[float | None, float | None]:
    """Return the standard uncertainty in the quantity's unit, and the coverage factor that it was divided by."""
    standard = next((e for e in inside if e.name in _STANDARD), None)
    expanded = next((e for e in inside if e.name in _EXPANDED), None)
    factor = next((e for e in inside if e.name in _FACTORS), None)
    if expanded is not None and factor is not None:
        k = _number(factor, where)
        if k < 1:
            raise InputError(
                "a coverage factor of at least 1", f"{k:g}", "Look at the certificate.", _at(factor, where)
            )
        return abs(_number(expanded, where)) / k, k
    return (None if standard is None else abs(_number(standard, where))), None


def _name(quantity: Element, every: Sequence[Element]) -> str:
    contents = [e for e in every if e.name == "content" and quantity in e.path]
    named = [e for e in contents if e.path[-1].name == "name" and e.path[-2] is quantity]
    return next((text for e in named if (text := " ".join(e.text.split()))), "")[:120]


def _factor(unit: str) -> float | None:
    r"""Return millimetres a unit, as D-SI writes it (``\milli\metre``) or plainly; None where it is no length."""
    words = [word for word in unit.strip().split("\\") if word]
    if not words or words[-1] not in _MM or len(words) > 2:
        return None
    if len(words) == 2:
        return _MM[words[-1]] * _PREFIXES[words[0]] if words[0] in _PREFIXES and words[-1] == "metre" else None
    return _MM[words[0]]


def _number(element: Element, where: str) -> float:
    try:
        value = float(element.text.strip())
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            "a number", repr(element.text.strip()[:40]), "Look at the certificate.", _at(element, where)
        )
    return value


def _at(element: Element, where: str) -> str:
    return f"{where}, line {element.line}"


def piece_words(one: Equipment) -> str:
    """Return a piece of equipment by name and serial number, else its kind: these are words of no language."""
    return " ".join(part for part in (one.name, one.serial) if part) or one.kind


def captured_until(session: Session, otherwise: str) -> str:
    """Return the day of the newest capture that tells it (ISO 8601), that of another moment where none does."""
    return max((capture.taken[:_DATE] for capture in session.captures if capture.taken), default=otherwise[:_DATE])


def is_overdue(one: Equipment, on: str) -> bool:
    """Return whether a piece's certificate was due before a day; False where either is not told as a date."""
    due = one.certificate.due if one.certificate is not None else None
    try:
        return bool(due) and date.fromisoformat((due or "")[:_DATE]) < date.fromisoformat(on[:_DATE])
    except ValueError:
        return False


def overdue_certificates(session: Session, otherwise: str) -> list[Finding]:
    """Return a warning for each piece of equipment whose certificate was due before its captures.

    `otherwise` is the moment that counts where no capture tells when it was taken: when it was solved, or now.
    """
    on = captured_until(session, otherwise)
    return [
        CERTIFICATE_OVERDUE(
            where="cell.equipment",
            piece=piece_words(one),
            due=one.certificate.due if one.certificate else "",
            on=on,
        )
        for one in session.cell.equipment or ()
        if is_overdue(one, on)
    ]
