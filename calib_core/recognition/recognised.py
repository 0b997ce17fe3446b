"""All files of a folder or a drop recognised together: each one named, poses handed to measurements."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib_core.arms.kinematics import arm_of, flange_of_joints
from calib_core.errors import CalibrationError
from calib_core.formats.format import Unit
from calib_core.poses.numbers import to_pose
from calib_core.recognition.conventions import Choice, chosen_convention, may_be_radians
from calib_core.recognition.copies import copied, with_copies, without_copies
from calib_core.recognition.file_content import look_at
from calib_core.recognition.pairing import By, natural, paired
from calib_core.recognition.taken import (
    MEASUREMENTS,
    GivenFile,
    Look,
    PoseList,
    PoseRow,
    Reason,
    TakenFor,
    nothing,
)

MOST_FILES = 5000
_SAME_MM = 1e-3


@dataclass(frozen=True)
class Pair:
    """A measurement and its pose, or either alone: places in the lists of files and poses.

    `point` is the measurement's place in a file of several, a laser tracker's.
    """

    file: int | None
    pose: int | None
    point: int | None = None

    def to_json(self) -> dict[str, int | None]:
        """Return it as JSON data; a tracker's points, which are no files to send, leave their pose alone."""
        return {"file": self.file if self.point is None else None, "pose": self.pose}


@dataclass(frozen=True)
class Recognised:
    """What files are, together.

    Attributes
    ----------
    looks : tuple of Look
        One a file, in the order in which they were given.
    poses : tuple of PoseRow
        Those that are used; their numbers are in `choice.convention`.
    pairs : tuple of Pair
        Measurements in their natural order, then poses without one.
    by : str
        How they were paired.
    choice : Choice or None
        The convention of the poses, and who says so.
    sphere_mm : float or None
        The sphere's diameter, where a file tells it.
    sphere_from : str
        Which file.
    doubts : tuple of Reason
    missing : tuple of Reason
        What is still needed.
    """

    looks: tuple[Look, ...]
    poses: tuple[PoseRow, ...]
    pairs: tuple[Pair, ...]
    by: By | None
    choice: Choice | None
    sphere_mm: float | None
    sphere_from: str
    doubts: tuple[Reason, ...]
    missing: tuple[Reason, ...]

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data, as the page gets it."""
        return {
            "files": [
                {
                    "name": look.file.name,
                    "taken_for": look.taken_for,
                    **look.reason.to_json(),
                    "preview": [list(point) for point in look.preview],
                }
                for look in self.looks
            ],
            "poses": [row.to_json() for row in self.poses],
            "pairs": [pair.to_json() for pair in self.pairs if pair.point is None or pair.pose is not None],
            "paired_by": self.by,
            "convention": None if self.choice is None else self.choice.to_json(),
            "sphere_diameter_mm": self.sphere_mm,
            "sphere_from": self.sphere_from or None,
            "doubts": [doubt.to_json() for doubt in self.doubts],
            "missing": [lack.to_json() for lack in self.missing],
        }


def recognise(
    files: Sequence[GivenFile],
    told: Mapping[str, TakenFor] | None = None,
    convention: str | None = None,
    sphere_mm: float | None = None,
    unit: Unit | None = None,
    arm: str | None = None,
) -> Recognised:
    """Return what files are: each of them is named, none is left out.

    Parameters
    ----------
    files : sequence of GivenFile
    told : mapping, optional
        What files are taken for, by name, whatever their content says.
    convention : str, optional
        In which the poses are written, where it is known.
    sphere_mm : float, optional
        The sphere's diameter, where it is known.
    unit : str, optional
        That of a laser tracker's points, where their file states none.
    arm : str, optional
        The robot's arm by its name: poses of controllers' files then get joints where these say how it stands.
    """
    looks = [_look(file, (told or {}).get(file.name), k, unit) for k, file in enumerate(files)]
    looks = with_joints(_with_controllers(_without_other_scanners(looks), arm), arm, convention)
    copy_of = copied([look.file for look in looks])
    looks = without_copies(looks, copy_of)
    order = sorted(
        (k for k, look in enumerate(looks) if look.taken_for in (*MEASUREMENTS, "centers")),
        key=lambda k: natural(looks[k].file.name),
    )
    measured = [place for k in order for place in _places(looks, k)]
    given = [_measurement(looks, *place) for place in measured]
    looks, lists, doubts = _pose_lists(looks, given)
    rows: list[PoseRow] = []
    pairs: dict[int, int] = {}
    by: By | None = None
    for group, poses in _by_folder(given, lists):
        found = paired([given[k].name for k in group], poses.rows)
        pairs |= {group[place]: len(rows) + row for place, row in found.row_of.items()}
        by = by or (found.by if found.row_of else None)
        doubts += [found.doubt] if found.doubt else []
        rows += poses.rows
    rows, pairs, not_whole = _whole(rows, pairs)
    doubts += not_whole
    looks, spare = with_copies(looks, copy_of, {measured[place][0] for place in pairs})
    measured_of = {place: at for place, at in enumerate(measured) if at[0] not in spare}
    known = {name for poses in lists for name in poses.conventions}
    choice = chosen_convention(rows, lists[0].conventions if known else (), convention, arm)
    if choice is not None:
        rows = [replace(row, numbers=choice.rewritten(row.numbers)) for row in rows]
    told_spheres = {look.sphere_mm: look.file.name for look in looks if look.sphere_mm is not None}
    sphere_from = ""
    if sphere_mm is None and len(told_spheres) == 1:
        sphere_mm, sphere_from = next(iter(told_spheres.items()))
    used = set(pairs.values())
    listed = [Pair(k, pairs.get(place), point) for place, (k, point) in measured_of.items()]
    listed += [Pair(None, k) for k in range(len(rows)) if k not in used]
    missing = [*_missing(looks, listed, choice, sphere_mm), *_open_angles(rows)]
    if any(poses.open_angles for poses in lists) and choice is not None and may_be_radians(rows, choice):
        (missing if convention is None else doubts).append(Reason("open-angles"))
    return Recognised(
        tuple(looks), tuple(rows), tuple(listed), by, choice, sphere_mm, sphere_from, tuple(doubts), tuple(missing)
    )


def _places(looks: Sequence[Look], k: int) -> list[tuple[int, int | None]]:
    """Return the measurements of a file: itself, or a tracker's points where their unit is known."""
    if looks[k].taken_for != "centers":
        return [(k, None)]
    centers = looks[k].centers
    return [] if centers is None or centers.unit is None else [(k, point) for point in range(len(centers.points))]


def _measurement(looks: Sequence[Look], k: int, point: int | None) -> GivenFile:
    """Return a measurement as a file by whose name its pose is found; a tracker's point has its own name."""
    file, centers = looks[k].file, looks[k].centers
    if centers is None or point is None:
        return file
    return replace(file, name=f"{file.folder}/{centers.points[point].name}".lstrip("/"))


def _without_other_scanners(looks: list[Look]) -> list[Look]:
    """Leave a tracker's points aside where other scans lie beside them: one session's scanner took either."""
    if not any(look.taken_for in ("profiles", "clouds", "frames") for look in looks):
        return looks
    return [
        replace(look, taken_for="nothing", reason=Reason("centers-beside", {"points": len(look.centers.points)}))
        if look.centers is not None
        else look
        for look in looks
    ]


def _look(file: GivenFile, told: TakenFor | None, place: int, unit: Unit | None) -> Look:
    if place >= MOST_FILES:
        return replace(nothing("beyond", most=MOST_FILES), file=file)
    if told == "nothing" or told in MEASUREMENTS:
        return Look(told, Reason("told"), file=file)
    try:
        look = look_at(file, unit)
    except CalibrationError as error:
        look = nothing("damaged", because=error.reason)
    if told is not None and look.taken_for != told:
        look = replace(look, taken_for=told, reason=Reason("told"))
    return replace(look, file=file)


def _with_controllers(looks: list[Look], arm: str | None) -> list[Look]:
    """Read controllers' files together, brand by brand, and name each for what it holds."""
    from calib_core.recognition.controllers import read_together

    places = [k for k, look in enumerate(looks) if look.brand]
    for k, look in read_together([looks[k] for k in places], arm).items():
        looks[places[k]] = look
    return looks


def _pose_lists(
    looks: list[Look], measurements: Sequence[GivenFile]
) -> tuple[list[Look], list[PoseList], list[Reason]]:
    """Return the lists of poses that are used: each once, single ones together, of rivals the one that fits."""
    stems = {file.stem.lower() for file in measurements}
    doubts: list[Reason] = []
    kept: list[int] = []
    single: list[int] = []
    for k, look in enumerate(looks):
        if look.poses is None or look.taken_for != "poses":
            continue
        if len(look.poses.rows) > 1 or look.file.stem.lower() in stems:
            same = next((other for other in kept if _same(looks[other].poses, look.poses)), None)
            if same is None:
                (single if len(look.poses.rows) == 1 else kept).append(k)
            else:
                values = {"poses": len(look.poses.rows), "other": looks[same].file.name}
                looks[k] = replace(look, reason=Reason("same-poses", values), poses=None)
        else:
            single.append(k)
    named = [k for k in single if looks[k].file.stem.lower() in stems]
    for k in single:
        if k not in named and len(single) < 2:
            keys = looks[k].reason.values.get("keys")
            reason = Reason("settings", {"keys": keys}) if keys else Reason("one-pose")
            looks[k] = replace(looks[k], taken_for="nothing", reason=reason, poses=None)
    single = [k for k in single if looks[k].poses is not None]
    lists = [_list(looks[k]) for k in kept]
    if len(single) > 1 or named:
        rows = [replace(_list(looks[k]).rows[0], name=looks[k].file.stem) for k in (named or single)]
        lists = [PoseList(tuple(rows), _list(looks[single[0]]).conventions)] if named or not lists else lists
        kept = [] if named or not kept else kept
    if len(kept) > 1 and len({looks[k].file.folder for k in kept}) < len(kept):
        fitting = [k for k in kept if len(_list(looks[k]).rows) == len(measurements)] or kept
        if len(fitting) > 1:
            names = ", ".join(looks[k].file.name for k in fitting[:3])
            doubts.append(Reason("rival-lists", {"names": names}))
        best = fitting[0]
        for k in kept:
            if k != best:
                values = {"poses": len(_list(looks[k]).rows), "measurements": len(measurements)}
                code = "rival-poses" if k in fitting else "other-poses"
                reason = Reason(code, {**values, "other": looks[best].file.name})
                looks[k] = replace(looks[k], reason=reason)
        lists = [_list(looks[best])]
    return looks, lists, doubts


def _whole(
    rows: Sequence[PoseRow], pairs: Mapping[int, int]
) -> tuple[list[PoseRow], dict[int, int], list[Reason]]:
    """Return poses without those of which a number lacks, whose they are, and a word about the rest."""
    new = {k: place for place, k in enumerate(k for k, row in enumerate(rows) if np.isfinite(row.numbers).all())}
    lines: dict[str, list[str]] = {}
    for k, row in enumerate(rows):
        if k not in new:
            lines.setdefault(row.file, []).append(str(row.line))
    not_whole = [Reason("rows-not-whole", {"name": name, "lines": _listed(some)}) for name, some in lines.items()]
    return [rows[k] for k in new], {place: new[k] for place, k in pairs.items() if k in new}, not_whole


def _open_angles(rows: Sequence[PoseRow]) -> list[Reason]:
    """Return what is said of rows without a table's angle, of a list that has a column of them."""
    lines: dict[str, list[str]] = {}
    for row in rows:
        if row.table_deg is None and row.has_table:
            lines.setdefault(row.file, []).append(str(row.line))
    return [Reason("missing-angles", {"name": name, "lines": _listed(some)}) for name, some in lines.items()]


def _listed(names: Sequence[str]) -> str:
    """Return names as any language lists them, the first of many."""
    return ", ".join([*names[:8], *(["…"] if len(names) > 8 else [])])


def _list(look: Look) -> PoseList:
    assert look.poses is not None
    return look.poses


def _same(one: PoseList | None, other: PoseList) -> bool:
    if one is None or len(one.rows) != len(other.rows):
        return False
    if {len(row.numbers) for row in (*one.rows, *other.rows)} != {len(one.rows[0].numbers)}:
        return False
    a, b = (np.array([row.numbers for row in poses.rows]) for poses in (one, other))
    return bool(np.allclose(a, b, rtol=0, atol=_SAME_MM, equal_nan=True))


def _by_folder(files: Sequence[GivenFile], lists: Sequence[PoseList]) -> list[tuple[list[int], PoseList]]:
    """Return the measurements that each list of poses is for: of its folder, where several folders have one."""
    if not lists:
        return []
    if len(lists) == 1:
        return [(list(range(len(files))), lists[0])]
    groups: dict[int, list[int]] = {}
    homes = [poses.rows[0].file.rpartition("/")[0] for poses in lists]
    for k, file in enumerate(files):
        near = [h for h, home in enumerate(homes) if not home or f"{file.folder}/".startswith(f"{home}/")]
        if near:
            groups.setdefault(max(near, key=lambda h: len(homes[h])), []).append(k)
    return [(groups.get(h, []), poses) for h, poses in enumerate(lists)]


def _missing(
    looks: Sequence[Look], pairs: Sequence[Pair], choice: Choice | None, sphere_mm: float | None
) -> list[Reason]:
    shown = [p for p in pairs if p.file is not None]
    if not shown:
        return [Reason("missing-measurements")]
    missing: list[Reason] = []
    posed = [p for p in shown if p.file is not None and looks[p.file].taken_for != "boards"]
    lacking = [_measurement(looks, p.file or 0, p.point).name for p in posed if p.pose is None]
    if lacking and len(lacking) == len(posed):
        missing.append(Reason("missing-poses"))
    elif lacking:
        missing.append(Reason("missing-poses-of", {"names": _listed(lacking)}))
    if choice is not None and not choice.sure and any(p.pose is not None for p in pairs):
        missing.append(Reason("missing-convention", {"choices": choice.why}))
    if sphere_mm is None and any(look.taken_for in ("profiles", "clouds") for look in looks):
        missing.append(Reason("missing-sphere"))
    return missing


def with_joints(looks: Sequence[Look], arm: str | None, convention: str | None) -> list[Look]:
    """Return looks in which each list of joints goes with a list of poses, or is one by the arm's lengths."""
    found = list(looks)
    for k, look in enumerate(looks):
        if not look.joints or look.poses is not None:
            continue
        other = next((n for n, one in enumerate(found) if one.poses and _alike(one.poses.rows, look.joints)), None)
        if other is not None and (poses := found[other].poses) is not None:
            found[other] = replace(found[other], poses=replace(poses, rows=_beside(poses.rows, look.joints)))
            reason = Reason("joints-of", {"poses": len(poses.rows), "other": found[other].file.name})
            found[k] = replace(look, taken_for="poses", reason=reason)
        elif arm is not None and len(arm_of(arm).joints) == len(look.joints[0].joints_deg or ()):
            reason = Reason("joints-by-arm", {"poses": len(look.joints), "arm": arm})
            made = [_posed(row, arm, convention or "matrix") for row in look.joints]
            poses = PoseList(tuple(made), (convention or "matrix",))
            found[k] = replace(look, taken_for="poses", reason=reason, poses=poses)
    return found


def _alike(poses: Sequence[PoseRow], joints: Sequence[PoseRow]) -> bool:
    """Return whether joints are of poses that have none: by their names, or as many in one order without names."""
    if any(row.joints_deg for row in poses):
        return False
    names = {row.name for row in joints}
    if len(names) == len(joints) and all(row.name for row in joints):
        return all(row.name in names for row in poses)
    return len(poses) == len(joints) and not any(row.name for row in (*poses, *joints))


def _beside(poses: Sequence[PoseRow], joints: Sequence[PoseRow]) -> tuple[PoseRow, ...]:
    by_name = {row.name: row for row in joints}
    own = joints if len(by_name) < len(joints) else [by_name[row.name] for row in poses]
    return tuple(replace(row, joints_deg=one.joints_deg) for row, one in zip(poses, own, strict=True))


def _posed(row: PoseRow, arm: str, convention: str) -> PoseRow:
    assert row.joints_deg is not None
    return replace(row, numbers=tuple(to_pose(convention, flange_of_joints(arm_of(arm), row.joints_deg))))
