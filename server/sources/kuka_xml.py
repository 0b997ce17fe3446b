"""The XML of KUKA's RSI and EKI: where the robot is, in elements with X … C, A1 … A6 and E1 … E6."""

from dataclasses import dataclass
from xml.etree import ElementTree

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.robots import parse_pose
from server.sources.device import Sample, host_now_s
from server.sources.pose_settings import ToolAndFrame, axis_number, flange_by_joints, flange_of

_POSE, _AXES, _EXTERNAL = "XYZABC", tuple(f"A{k}" for k in range(1, 7)), tuple(f"E{k}" for k in range(1, 7))
_SETPOINTS = ("rsol", "aspos", "espos")  # where it shall be, not where it is
_CYCLE_S = 0.001  # IPOC counts milliseconds


@dataclass(frozen=True)
class Told:
    """What a telegram tells; empty where it does not."""

    pose: tuple[float, ...] = ()
    joints_deg: tuple[float, ...] = ()
    external: tuple[float, ...] = ()
    clock_s: float | None = None


def parse_telegram(text: str) -> Told:
    """Return what a telegram such as ``<Rob Type="KUKA"><RIst X="…" …/><AIPos A1="…" …/></Rob>`` tells.

    Numbers are attributes, as RSI sends them, or elements of their own, as EKI may.

    Raises
    ------
    InputError
        If it is no XML, or a number is none.
    """
    if "<!" in text:  # no document type, so no entities of its own
        raise InputError("a telegram of RSI or EKI", "XML with a declaration", "Send elements alone.")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        need = "a telegram of RSI or EKI"
        raise InputError(need, "XML that cannot be read ({error})", "Send it whole.", error=error) from None
    told: dict[str, tuple[float, ...]] = {}
    for element in root.iter():
        if element.tag.lower() in _SETPOINTS:
            continue
        values = {**{child.tag: child.text or "" for child in element if not len(child)}, **element.attrib}
        for what, names in (("pose", _POSE), ("joints_deg", _AXES), ("external", _EXTERNAL)):
            present = [name for name in names if name in values]
            if what not in told and (len(present) == 6 or (what == "external" and present)):
                told[what] = tuple(_number(values[name], name) for name in present)
    ipoc = root.findtext("IPOC")
    return Told(**told, clock_s=None if ipoc is None else _number(ipoc, "IPOC") * _CYCLE_S)


def sample_of(told: Told, settings: ToolAndFrame, table_axis: str | None) -> Sample:
    """Return where robot and table stand; raises InputError where a telegram tells neither."""
    pose = None
    if settings.arm and told.joints_deg:
        pose = flange_by_joints(settings.arm, told.joints_deg)
    elif told.pose:
        pose = flange_of(settings, "kuka", parse_pose("kuka", list(told.pose)))
    table_deg = axis_number(table_axis, told.external)
    if pose is None and table_deg is None:
        got = message("a telegram with neither")
        raise InputError("X, Y, Z, A, B, C of the robot", got, "Add DEF_RIst to what the controller sends.")
    return Sample(host_now_s(), told.clock_s, pose, told.joints_deg or None, table_deg)


def _number(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError("a number of {name}", repr(text[:20]), "Send it as 123.456.", name, name=name) from None
