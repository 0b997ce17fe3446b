"""Universal Robots: programs (.urp) and installations, as PolyScope keeps them: XML, gzipped.

A waypoint has joints and, beside them, the arm's Denavit-Hartenberg table as the program was saved with it: they
give the pose of its flange, whatever `TCPOffset` and `BaseToFeature` are: the pose that PolyScope writes into the
script of the same program.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from calib_core.arms.kinematics import flange_of_joints
from calib_core.formats.shared.xml_file import Element, elements
from calib_core.messages import explained, message
from calib_core.poses.numbers import to_pose
from calib_core.records import ArmJoint, ArmTable
from calib_core.robots.controller_file import Found, Frame, Taught
from calib_core.robots.text import numbers
from calib_core.robots.ur.values import degrees, plausible

_PARAMETERS = ("deltaTheta", "a", "d", "alpha")
_LEAST_REACH_M = 0.05  # of a table that is filled in


@dataclass(frozen=True)
class Tcp:
    """One TCP of an installation: `attribute` holds its numbers, or the element's text where that is empty."""

    name: str
    identity: str
    element: Element
    attribute: str
    text: str


def tcps(found: Iterable[Element]) -> list[Tcp]:
    """Return the TCPs of an installation in their order, whatever their numbers are."""
    result: list[Tcp] = []
    for element in found:
        plain = element.name.lower()
        if plain == "tcpoffset" or "tcp" not in plain:
            continue
        attribute = next((name for name in ("offset", "pose") if name in element.attributes), "")
        text = element.attributes[attribute] if attribute else element.text
        if not attribute and plain != "tcptransform":
            continue
        around = [element, *reversed(element.path)]
        name = next((e.attributes["name"] for e in around if e.attributes.get("name")), f"TCP {len(result) + 1}")
        identity = next((e.attributes["id"] for e in around if e.attributes.get("id")), "")
        result.append(Tcp(name, identity, element, attribute, text))
    return result


def found_in(data: bytes, name: str) -> Found:
    """Return what stands in a program or an installation; raises InputError where it is no whole XML."""
    found = Found(name)
    parts = elements(data, name)
    active = next((e.attributes["activePose"] for e in parts if e.attributes.get("activePose")), None)
    for tcp in tcps(parts):
        try:
            pose = plausible(numbers(tcp.text.strip().strip("p[] "), 6))
        except ValueError as error:
            found.skip(tcp.element.line, message("TCP {tcp}: {error}", tcp=tcp.name, error=error))
            continue
        found.tools.append(Frame(tcp.name, tcp.name, pose, "ur", tcp.element.line, name))
        if active in (tcp.name, tcp.identity):
            found.active_tool = tcp.name
    arms = _Arms(parts)
    for element in parts:
        if element.name == "JointAngles":
            try:
                _waypoint(element, arms, found)
            except ValueError as error:
                found.skip(element.line, explained(f"{_name(element)}", error), _name(element))
    return found


def _name(joints: Element) -> str:
    waypoint = next((e for e in reversed(joints.path) if e.name == "Waypoint"), None)
    return (waypoint.attributes.get("name") if waypoint else None) or message("line {number}", number=joints.line)


def scripts_in(data: bytes, name: str) -> list[tuple[str, int]]:
    """Return the scripts that a program keeps copies of, each with the line at which it begins."""
    return [(e.text, e.line) for e in elements(data, name) if e.name == "cachedContents" and e.text.strip()]


def _waypoint(joints: Element, arms: "_Arms", found: Found) -> None:
    name = _name(joints)
    waypoint = next((e for e in reversed(joints.path) if e.name == "Waypoint"), None)
    kind = waypoint.attributes.get("type") if waypoint else None
    if kind not in (None, "Fixed"):
        found.skip(
            joints.line,
            message("{name}: a waypoint of type {kind} is no certain place", name=name, kind=kind),
            name,
        )
        return
    angles = degrees(numbers(joints.attributes.get("angles", ""), 6))
    arm, doubt = arms.of(joints)
    pose = None if arm is None else tuple(v + 0.0 for v in to_pose("ur", flange_of_joints(arm, angles)))
    tool, frame = (None, None) if pose is None else (0, "base")
    found.poses.append(
        Taught(name, pose, "ur", joints.line, angles, None, tool, frame, found.file, doubt=doubt if pose else "")
    )


class _Arms:
    """The arm's tables in a program: one beside each waypoint, and the program's own."""

    def __init__(self, parts: Sequence[Element]) -> None:
        self._rows: dict[int, dict[str, str]] = {}
        self._beside: dict[int, Element] = {}
        self._own: Element | None = None
        for element in parts:
            if element.name == "kinematics":
                self._own = self._own or element
            elif element.name == "Kinematics" and element.path:
                self._beside[id(element.path[-1])] = element
            elif element.path and element.path[-1].name in ("kinematics", "Kinematics"):
                self._rows.setdefault(id(element.path[-1]), {})[element.name] = element.attributes.get("value", "")

    def of(self, joints: Element) -> tuple[ArmTable | None, str]:
        """Return the arm of a waypoint's joints, and what is left open about it."""
        beside = self._beside.get(id(joints.path[-1])) if joints.path else None
        for table in (beside, self._own):
            rows = self._rows.get(id(table), {})
            if table is None or any(name not in rows for name in _PARAMETERS):
                continue
            theta, a, d, alpha = (numbers(rows[name], 6) for name in _PARAMETERS)
            if sum(map(abs, a)) < _LEAST_REACH_M or sum(map(abs, alpha)) < 1:
                continue  # a program that no robot has saved yet
            joint = [
                ArmJoint(
                    a_mm=1e3 * a_m, d_mm=1e3 * d_m, alpha_deg=math.degrees(turn), theta_deg=math.degrees(start)
                )
                for start, a_m, d_m, turn in zip(theta, a, d, alpha, strict=True)
            ]
            return ArmTable(joints=joint), "" if table.attributes.get("status") == "LINEARIZED" else _NOMINAL
        return None, ""


_NOMINAL = (
    "The program holds the arm's nominal lengths, not those of its calibration: its poses may be some "
    "millimetres off. Save it on the robot itself, or export it as .script."
)


def with_tcp(plain: bytes, tcp: Tcp, pose: str) -> bytes | None:
    """Return an installation with one TCP's numbers changed, None where they do not stand as usual."""
    if tcp.attribute:
        pattern = rb"<[^<>]*?\s" + tcp.attribute.encode() + rb"\s*=\s*([\"'])([^\"'<>]*)\1"
        match = re.compile(pattern).match(plain, tcp.element.start)
        span = match.span(2) if match else None
    else:
        match = re.compile(rb"<[^<>]*>([^<>]*)<").match(plain, tcp.element.start)
        span = match.span(1) if match else None
    return None if span is None else plain[: span[0]] + pose.encode() + plain[span[1] :]
