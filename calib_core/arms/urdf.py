"""An arm's joints from a URDF: the chain of links from the robot's base to its flange; shapes are not read."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib_core.arms.ur_calibration import arm_from_ur_calibration, is_ur_calibration
from calib_core.errors import InputError, TooLargeError
from calib_core.formats.shared.number import number
from calib_core.formats.shared.xml_file import Element, elements
from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.messages import message
from calib_core.poses.rotations import rotation_from_angles
from calib_core.records import ArmJoint, ArmTable

MAX_BYTES = 5_000_000
_BASES = ("base", "base_link")
_TIPS = ("tool0", "flange")
_MOVES = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_MOST_LINKS = 2000


@dataclass(frozen=True, eq=False)
class _Joint:
    """A joint as the file has it: its frame (4, 4) in its parent's, mm, and the axis (3,) along which it moves."""

    name: str
    kind: str
    parent: str
    child: str
    parent_from_joint: FloatArray
    axis: FloatArray
    limits: tuple[float, float] | None


def arm_from_urdf(data: bytes, name: str, base: str | None = None, tip: str | None = None) -> ArmTable:
    """Return the table of an arm's joints from its URDF, or a UR's from its calibration (`ur_calibration`).

    Parameters
    ----------
    data : bytes
    name : str
        The file's, for messages.
    base, tip : str, optional
        The links between which the arm is; without them `base` (else `base_link`, else the root) and `tool0`
        (else `flange`, else the end of the longest chain).

    Raises
    ------
    InputError
        If it is no URDF, declares entities, or its chain is none of up to twelve joints that move by themselves.
    TooLargeError
        If it is beyond 5 MB.
    """
    if is_ur_calibration(data):
        return arm_from_ur_calibration(data, name)
    if len(data) > MAX_BYTES:
        to_do = "Leave its meshes out."
        raise TooLargeError("a URDF of at most 5 MB", "{count:.1f} MB", to_do, name, count=len(data) / 1000000.0)
    joints = _joints(elements(data, name), name)
    by_child = {joint.child: joint for joint in joints.values()}
    links = {joint.parent for joint in by_child.values()} | by_child.keys()
    start = _link(base, _BASES, links, name) or _root(by_child, links)
    end = _link(tip, _TIPS, links, name) or max(links, key=lambda link: _moving(_way_up(link, by_child, name)))
    return _table(_way_up(start, by_child, name), _way_up(end, by_child, name), f"{name}: {start} → {end}", name)


def _table(to_base: list[_Joint], to_tip: list[_Joint], source: str, name: str) -> ArmTable:
    """Return the joints between two ways from the root, of which the first may only be fixed where it leaves."""
    shared = sum(1 for a, b in zip(to_base, to_tip, strict=False) if a is b)
    aside, along = to_base[shared:], to_tip[shared:]
    if _moving(aside) or not _moving(along):
        got = message(
            "{along} on the way to the tip, and {aside} on the way to the base",
            along=_moving(along),
            aside=_moving(aside),
        )
        to_do = message("Name the links at the arm's base and flange.")
        raise InputError("joints that lead from the base to the flange", got, to_do, name)
    place = np.eye(4)
    for joint in aside:
        place = place @ joint.parent_from_joint
    place = np.linalg.inv(place)
    found: list[ArmJoint] = []
    for joint in along:
        place = place @ joint.parent_from_joint
        if joint.kind == "fixed":
            continue
        turned = _z_along(joint.axis)
        found.append(
            ArmJoint(
                name=joint.name,
                kind="prismatic" if joint.kind == "prismatic" else "revolute",
                previous_from_joint=(place @ turned).tolist(),
                limits=joint.limits,
            )
        )
        place = turned.T
    if len(found) > 12:
        need = "at most 12 joints"
        raise InputError(need, f"{len(found)}", "Name the links at the arm's base and flange.", name)
    return ArmTable(joints=found, last_from_tool0=place.tolist(), source=source)


def _joints(rows: list[Element], name: str) -> dict[str, _Joint]:
    if not rows or rows[0].name != "robot":
        got = f"<{rows[0].name}>" if rows else message("no element")
        raise InputError("a URDF, which begins with <robot>", got, "Give the arm's own description.", name)
    inside: dict[int, dict[str, Mapping[str, str]]] = {}
    for row in rows:
        if row.path:
            inside.setdefault(id(row.path[-1]), {}).setdefault(row.name, row.attributes)
    found: dict[str, _Joint] = {}
    for row in rows:
        if row.name == "joint" and len(row.path) == 1:
            joint = _joint(row, inside.get(id(row), {}), name)
            found[joint.name] = joint
    if not found or len(found) > _MOST_LINKS:
        to_do = "Give the arm's own description."
        raise InputError("a URDF with joints", "{count} of them", to_do, name, count=len(found))
    return found


def _joint(row: Element, inside: dict[str, Mapping[str, str]], name: str) -> _Joint:
    own, kind = row.attributes.get("name", ""), row.attributes.get("type", "")
    where = f"{name}, line {row.line}, joint {own}"
    if kind not in (*_MOVES, "fixed"):
        to_do = "Leave it out."
        raise InputError("a joint that is fixed, revolute, continuous or prismatic", f"'{kind}'", to_do, where)
    if "mimic" in inside and kind != "fixed":
        to_do = "Give its table instead."
        raise InputError("joints that move by themselves", "one that mimics another", to_do, where)
    origin = inside.get("origin", {})
    roll, pitch, yaw = _three(origin.get("rpy", "0 0 0"), where)
    frame = np.eye(4)
    frame[:3, :3] = rotation_from_angles("ZYX", [yaw, pitch, roll])
    frame[:3, 3] = 1000.0 * _three(origin.get("xyz", "0 0 0"), where)
    axis = _three(inside.get("axis", {}).get("xyz", "1 0 0"), where)
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise InputError("an axis with a direction", "0 0 0", "Correct it.", where)
    kind = _MOVES.get(kind, "fixed")
    limits = None if row.attributes.get("type") == "continuous" else _limits(inside.get("limit"), kind, where)
    parent, child = (inside.get(side, {}).get("link", "") for side in ("parent", "child"))
    return _Joint(own, kind, parent, child, frame, axis / length, limits)


def _limits(given: Mapping[str, str] | None, kind: str, where: str) -> tuple[float, float] | None:
    """Return a joint's limits in degrees or mm."""
    if given is None or kind == "fixed":
        return None
    low, high = (_number(given.get(side, "0"), where) for side in ("lower", "upper"))
    scale = 1000.0 if kind == "prismatic" else 180.0 / np.pi
    return (low * scale, high * scale) if low < high else None


def _three(text: str, where: str) -> FloatArray:
    parts = text.split()
    if len(parts) != 3:
        raise InputError("three numbers", f"'{text[:40]}'", "Run xacro first: it computes them.", where)
    return np.array([_number(part, where) for part in parts])


def _number(text: str, where: str) -> float:
    try:
        return number(text)
    except ValueError:
        raise InputError("a number", f"'{text[:40]}'", "Run xacro first: it computes them.", where) from None


def _z_along(axis: FloatArray) -> FloatArray:
    """Return a rotation (4, 4) whose z is an axis."""
    turned = np.eye(4)
    across = np.cross([0.0, 0.0, 1.0], axis)
    sine = float(np.linalg.norm(across))
    if sine > 1e-12:
        turned[:3, :3] = rotation_from_vector(across / sine * np.arctan2(sine, axis[2]))
    elif axis[2] < 0:
        turned[:3, :3] = np.diag([1.0, -1.0, -1.0])
    return turned


def _link(named: str | None, usual: tuple[str, ...], links: set[str], name: str) -> str | None:
    if named is not None and named not in links:
        to_do = "Name one of these."
        raise InputError("a link '{named}'", ", ".join(sorted(links)[:12]), to_do, name, named=named)
    return named or next((link for link in usual if link in links), None)


def _root(by_child: Mapping[str, _Joint], links: set[str]) -> str:
    return min((link for link in links if link not in by_child), default=min(links))


def _way_up(link: str, by_child: Mapping[str, _Joint], name: str) -> list[_Joint]:
    """Return the joints from the root to a link."""
    way: list[_Joint] = []
    while link in by_child:
        way.append(by_child[link])
        link = by_child[link].parent
        if len(way) > len(by_child):
            raise InputError("links that form a tree", "a chain that closes", "Correct it.", name)
    return way[::-1]


def _moving(way: list[_Joint]) -> int:
    return sum(joint.kind != "fixed" for joint in way)
