"""A tool as it stands in a controller, compared with the right one: equal, or what differs, in words."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Any

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.shared.number import number
from calib_core.frames import RigidTransform
from calib_core.messages import message, plural, sentences
from calib_core.poses.convention import Convention
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.numbers import convention_named, parse_pose, to_pose
from calib_core.records.faults import FAULTS
from calib_core.robots.backup import read_controller_files
from calib_core.robots.controller_file import Frame

_POSITION_MM, _ROTATION_DEG = 0.01, 0.005
"""What pendants round away: two decimals of a millimetre, three of a degree and the like."""


@dataclass(frozen=True)
class ReadBack:
    """The outcome of a comparison.

    Parameters
    ----------
    equal : bool
    words : str
        What is the matter, as a sentence.
    position_mm, rotation_deg : float
        How far the two frames are from each other as the numbers stand.
    faults : tuple of str
        What speaks against using the answer that was compared with, by name.
    """

    equal: bool
    words: str
    position_mm: float
    rotation_deg: float
    faults: tuple[str, ...] = ()

    def of_answer(self, faults: Sequence[str]) -> "ReadBack":
        """Return the outcome of a comparison with an answer that has faults: its words say so."""
        if not faults:
            return self
        told = [
            message("But the answer is {found}. {advice}", found=FAULTS[name].got, advice=FAULTS[name].to_do)
            for name in faults
        ]
        return replace(self, words=sentences([self.words, *told]), faults=tuple(faults))

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data; distances are null where the numbers are no pose."""
        finite = math.isfinite(self.position_mm)
        return {
            "equal": self.equal,
            "words": self.words,
            "position_mm": self.position_mm if finite else None,
            "rotation_deg": self.rotation_deg if finite else None,
            "faults": list(self.faults),
        }


def typed_numbers(text: str, convention: str) -> list[float]:
    """Return a convention's numbers as a person types them, with decimal commas too; raises InputError."""
    parts = text.replace(";", " ").split()
    if "." not in text and len(parts) == convention_named(convention).count:
        text = text.replace(",", ".")
    try:
        return [number(part) for part in text.replace(",", " ").replace(";", " ").split()]
    except ValueError as error:
        raise InputError("numbers with blanks between", str(error), "Type them again.", "numbers") from None


def frame_in(
    files: Mapping[str, bytes], brand: str | None, named: str | None, into: Collection[str]
) -> tuple[str, list[float], str]:
    """Return convention and numbers of a frame in a controller's files, by its number or name, and what it is in.

    `into`: `tool0` for tools, `base` for user frames (of a script: its variables).  Where both are wanted and one
    name is of either, the tool counts.

    Raises
    ------
    InputError
        If there is none like it, or several and none is named.
    """
    read = read_controller_files(files, brand)
    in_base = [
        Frame(one.name, None, pose, one.convention, one.line)
        for one in read.poses
        if one.frame == "base" and (pose := one.as_written or one.pose) is not None
    ]
    each = {"tool0": read.tools, "base": read.frames or in_base}
    listed = [(one, on) for on, frames in each.items() if on in into for one in frames if one.group == 1]
    found = [one for one in listed if named is None or named in (str(one[0].number), one[0].name)]
    found = [one for one in found if one[1] == found[0][1]]
    if len(found) != 1:
        names = ", ".join(str(one.number) for one, _ in listed) or "none"
        to_do = message("Name one with --tool.")
        need = message("one tool of the file") if "tool0" in into else message("one user frame of the file")
        raise InputError(need, "these: {names}", to_do, next(iter(files)), names=names)
    one, on = found[0]
    return one.convention, list(one.pose), on


def read_back(numbers: Sequence[float], convention: str, expected: RigidTransform) -> ReadBack:
    """Compare a tool's numbers, as they stand in the controller, with the tool that they should be.

    Parameters
    ----------
    numbers : sequence of float
        In the convention's order and units.
    convention : str
    expected : RigidTransform
        The tool, or the frame of a table.

    Raises
    ------
    InputError
        If the convention is unknown or the count of numbers is not its.
    """
    known = convention_named(convention)
    if len(numbers) != known.count or not all(map(math.isfinite, numbers)):
        parse_pose(convention, numbers)  # says what is wrong with them
    target = RigidTransform(expected.matrix, "base", "tool0")
    apart = _apart(known, numbers, target)
    if apart and _is_same(apart):
        return ReadBack(True, message("Equal to the digits that a controller keeps."), *apart)
    far = apart or (math.inf, math.inf)
    for words, changed, name in _mistakes(known, list(numbers)):
        found = _apart(CONVENTIONS[name], changed, target)
        if found and _is_same(found):
            return ReadBack(False, words, *far)
    return ReadBack(False, _differences(known, numbers, target, far), *far)


def _is_same(apart: tuple[float, float]) -> bool:
    return apart[0] <= _POSITION_MM and apart[1] <= _ROTATION_DEG


def _apart(known: Convention, numbers: Sequence[float], target: RigidTransform) -> tuple[float, float] | None:
    try:
        xi = parse_pose(known.name, numbers).difference(target)
    except InputError:
        return None
    return float(np.linalg.norm(xi[3:])), math.degrees(float(np.linalg.norm(xi[:3])))


_Mistake = tuple[str, list[float], str]


def _mistakes(known: Convention, numbers: list[float]) -> Iterator[_Mistake]:
    """Yield mistakes that people make, likeliest first: alone, then together with a wrong unit of length."""
    yield from _units(known, numbers)
    yield from _orders(known, numbers)
    yield from _wholes(known, numbers)
    if known.form != "matrix":
        scale, words = _other_length(known)
        scaled = [v * scale for v in numbers[:3]] + numbers[3:]
        for more, changed, name in [*_orders(known, scaled), *_wholes(known, scaled)]:
            yield sentences([words, more]), changed, name


def _other_length(known: Convention) -> tuple[float, str]:
    """Return the factor of positions in the other unit of length, and the words for it."""
    if known.mm_per_unit == 1000:
        return 1e-3, message("The position is in millimetres, not in metres.")
    return 1000.0, message("The position is in metres, not in millimetres.")


def _units(known: Convention, numbers: list[float]) -> Iterator[_Mistake]:
    scale, in_other_length = _other_length(known)
    if known.form == "matrix":
        changed = np.array(numbers).reshape(4, 4)
        changed[:3, 3] *= scale
        yield in_other_length, changed.ravel().tolist(), known.name
        return
    scaled = [v * scale for v in numbers[:3]]
    yield in_other_length, scaled + numbers[3:], known.name
    if known.form != "quaternion":
        factor, words = 180 / math.pi, message("Radians taken for degrees.")
        if known.form == "rotation-vector":
            factor, words = math.pi / 180, message("Degrees taken for radians.")
        turned = [v * factor for v in numbers[3:]]
        yield words, numbers[:3] + turned, known.name
        yield sentences([words, in_other_length]), scaled + turned, known.name


def _orders(known: Convention, numbers: list[float]) -> Iterator[_Mistake]:
    """Yield swapped numbers, wrong signs, and numbers of another convention."""
    if known.form == "matrix":
        columns = np.array(numbers).reshape(4, 4).T
        words = message("The matrix is written column by column (transposed).")
        yield words, columns.ravel().tolist(), known.name
        return
    names = known.numbers.split()
    for begin, end in ((3, len(names)), (0, 3)):
        for order in permutations(range(begin, end)):
            moved = [i for i, j in zip(range(begin, end), order, strict=True) if i != j]
            if moved:
                changed = numbers[:begin] + [numbers[i] for i in order] + numbers[end:]
                told = [names[i] for i in moved]
                swapped = message("{names} are swapped.", names=told)
                words = swapped if len(moved) == 2 else message("{names} are in another order.", names=told)
                yield words, changed, known.name
    for signs in product((1, -1), repeat=len(names)):
        wrong = [name for name, sign in zip(names, signs, strict=True) if sign < 0]
        if 0 < len(wrong) <= 3:
            changed = [v * s for v, s in zip(numbers, signs, strict=True)]
            words = plural("{names} has the wrong sign.", "{names} have the wrong sign.", by="names", names=wrong)
            yield words, changed, known.name
    for other in CONVENTIONS.values():
        if other.count == known.count and other.name != known.name:
            words = message(
                "The numbers are written as {other} writes them ({formula}), not as {known}.",
                other=other.name,
                formula=other.formula,
                known=known.name,
            )
            yield words, numbers, other.name


def _wholes(known: Convention, numbers: list[float]) -> Iterator[_Mistake]:
    try:
        pose = parse_pose(known.name, numbers)
    except InputError:
        return
    inverse = RigidTransform(pose.inverse().matrix, "base", "tool0")
    yield message("It is the inverse (the flange in the scanner)."), to_pose(known.name, inverse), known.name
    turned = RigidTransform.of(pose.rotation.T, pose.translation_mm, "base", "tool0")
    words = message("Its rotation is transposed (the inverse rotation).")
    yield words, to_pose(known.name, turned), known.name
    half = RigidTransform.of([0.0, 0.0, math.pi], [0.0, 0.0, 0.0], "base", "base") @ pose
    words = message("It is turned by half a turn about z (ROS's base_link and the controller's base differ so).")
    yield words, to_pose(known.name, half), known.name


def _differences(
    known: Convention, numbers: Sequence[float], target: RigidTransform, apart: tuple[float, float]
) -> str:
    if not math.isfinite(apart[0]):
        return message("The numbers are no pose in this convention: check their order and their unit.")
    wanted = to_pose(known.name, target)
    degrees = known.form in ("ZYX", "XYZ", "ZYZ")
    told = [_POSITION_MM / known.mm_per_unit] * 3 + [_ROTATION_DEG if degrees else 1e-4] * (known.count - 3)
    rows = zip(known.numbers.split(), numbers, wanted, told, strict=True)
    differing = [
        message("{name} {read:.6g} instead of {wanted:.6g}", name=name, read=v, wanted=w)
        for name, v, w, limit in rows
        if abs(v - w) > limit
    ]
    far = message("They are {apart_mm:.3f} mm and {apart_deg:.4f}° apart.", apart_mm=apart[0], apart_deg=apart[1])
    few = known.form != "matrix" and 0 < len(differing) < known.count
    return sentences([far, message("What differs: {differing:,}.", differing=differing)]) if few else far
