"""Scans that do not fit together: which mistake makes pairs of surfaces appear when it is taken back."""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations

import numpy as np

from calib_core.captures.placement import Placement
from calib_core.captures.scans import ScanGroup, SessionScans, poses_of
from calib_core.causes.readings import MM_PER_UNIT, Reading, changes_of, readings
from calib_core.cell.carriers import stands_still
from calib_core.errors import CalibrationError
from calib_core.findings.codes import merge as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.fusion.clean import clean_scan
from calib_core.fusion.overlap import Patches, SeenBy, joined_patches, seen_by
from calib_core.fusion.solve import Fit, Looked, coarse, fit
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records import Capture, Changes, Finding, Session
from calib_core.stages.merge.trials import (
    LEAST_PAIRS,
    MORE,
    PATCH_SPACINGS,
    Tried,
    about_z,
    extent_mm,
    impossible_among,
    impossible_of_scan,
    impossible_share,
    mirrored,
    pairs_with,
    remedy_of,
    same_arrangement,
)

_MUDDLED = 0.03  # of the surfaces one before the other, those that stand in a line of sight: of right merges 0.01
_RUBBLE = 0.25
_RUBBLE_OF_FEW, _FEW_PAIRS = 0.1, 0.1  # where of all patches fewer than these lie together
_ASTRAY, _WITHOUT = 0.08, 0.4  # of one scan; of what all have, what is left to the others without it
_PAIRED = 0.5  # of what a patch of the others pairs: a scan that fits pairs as they do, whatever stands before it
_FEW_APART, _FEW_TOGETHER = 0.002, 0.005  # of all compared, those in lines of sight that say nothing
_MOST_CHECKED = 3
_MORE_BY_STEPS, _MORE_BY_TWO = 1.15, 1.04  # of the score, as `MORE`
_FACTORS = 1 + np.arange(-0.2, 0.2001, 0.004)
_NEARBY, _NEAR = np.linspace(-0.016, 0.016, 33), 0.15
_UNITS = (float(np.rad2deg(1)), float(np.deg2rad(1)), 0.9, 10 / 9, 360.0, 0.5, 2.0)
_MOST_SCANS = 150
_MOST_SUSPECTS = 6
_SMALLER = 0.02  # of the others' size: metres
_LEAST_MM = 2.0  # nobody scans so little of an object
_MOST_READ_AGAIN = 24
_BY_EACH_SCAN = ("told", "ball", "rays")  # how the outside was found without regard to where scans stand


class Mistakes:
    """Looks for what keeps scans from fitting together.

    Parameters
    ----------
    session : Session
    groups : sequence of ScanGroup
    placement : Placement
    scans : SessionScans
    table_is_known : bool
        Whether the user brings the table, so that its sense of turning is told and not found.
    """

    def __init__(
        self,
        session: Session,
        groups: Sequence[ScanGroup],
        placement: Placement,
        scans: SessionScans,
        table_is_known: bool,
    ) -> None:
        self._session, self._placement, self._scans, self._table_is_known = (
            session,
            placement,
            scans,
            table_is_known,
        )
        self._groups = {group.name: group for group in groups}
        self._numbers = {group.name: number for number, group in enumerate(groups)}

    def find(self, looked: Looked) -> list[Finding]:
        """Return the mistakes, the one that explains most first; an error is among them where it is no merge."""
        tiny = self._in_metres(looked)
        if tiny:
            return tiny
        apart = looked.overlap
        if len(looked.used) < 2 or len(looked.used) > _MOST_SCANS:
            return []
        # Borders and bends put a few in a thousand into lines of sight, also where all scans fit together.
        fewest = _FEW_APART if apart.pairs < LEAST_PAIRS else _FEW_TOGETHER
        out = looked.outward
        impossible = out.impossible if out.impossible * (out.before + out.behind) > fewest else 0.0
        alone = [k for k in range(len(looked.used)) if apart.per_scan[k, 0] == 0]
        astray = self._astray(looked)
        if not (impossible > _MUDDLED or alone or astray or apart.pairs < LEAST_PAIRS):
            return []
        angles = self._one_angle(looked)
        if angles:
            return angles
        seen = coarse(looked.patches)
        now = fit(seen)
        tried = sorted(self._tried(looked, seen, now), key=lambda one: -one.fit.score)
        for one in tried[:_MOST_CHECKED]:
            share = impossible_share(seen, one.ways, looked.directions)
            if looked.outward.how not in _BY_EACH_SCAN:  # rubble does not tell which way is out
                share = min(share, 1 - share)
            borders = _RUBBLE_OF_FEW if one.fit.pairs > len(seen.scans) else _MUDDLED
            if share < max(borders, 0.5 * impossible):
                return [one.finding(now, one.fit)]
        elsewhere = self._elsewhere(looked, {*alone, *astray}) if apart.pairs else []
        if elsewhere:
            return elsewhere
        few = apart.pairs < _FEW_PAIRS * len(looked.patches.scans)
        if impossible > (_RUBBLE_OF_FEW if few else _RUBBLE):
            return [codes.SCANS_DO_NOT_FIT(pairs=apart.pairs, impossible_percent=100 * impossible)]
        return []

    def _tried(self, looked: Looked, seen: Patches, now: Fit) -> Iterator[Tried]:
        """Give the mistakes that make clearly more pairs when they are taken back."""
        where = [self._way(name) for name in looked.used]
        for one in (
            *self._of_table(looked, seen),
            *self._of_poses(looked, seen, where),
            *mirrored(self._captures(looked.used), seen, where),
            *self._of_two(looked, seen, now, where),
        ):
            if one.fit.pairs >= LEAST_PAIRS and one.fit.score > one.more * max(now.score, 1.0):
                yield one

    def _captures(self, names: Sequence[str]) -> list[Capture]:
        return [capture for name in names for capture in self._groups[name].captures]

    def _way(self, name: str) -> FloatArray:
        capture, pose = self._middle(name)
        return self._placement.way(capture, pose).matrix

    def _middle(self, name: str) -> tuple[Capture, RigidTransform]:
        pairs = poses_of(self._session, self._groups[name], self._placement)
        return pairs[len(pairs) // 2]

    def _degrees(self, looked: Looked) -> FloatArray | None:
        told = [self._groups[name].captures[0].table_deg for name in looked.used]
        if self._placement.base_from_turntable is None or any(one is None for one in told):
            return None
        return np.array(told, dtype=float)

    def _one_angle(self, looked: Looked) -> list[Finding]:
        degrees = self._degrees(looked)
        if degrees is None or np.ptp(degrees) > 0:
            return []
        return [codes.ONE_TABLE_ANGLE(angle_deg=float(degrees[0]))]

    # Angles of the table

    def _of_table(self, looked: Looked, seen: Patches) -> Iterator[Tried]:
        degrees = self._degrees(looked)
        if degrees is None or not np.ptp(degrees) > 0:
            return
        turned = self._placement.direction * self._placement.scale * np.deg2rad(degrees)

        def by(factor: float) -> Fit:
            return fit(seen, about_z((1 - factor) * turned))

        yield Tried(about_z(2 * turned), by(-1.0), MORE, lambda now, then: self._direction(looked, now, then))
        if len(degrees) < 4:
            return
        tried = {factor: by(factor) for factor in (*_FACTORS.tolist(), *_UNITS) if abs(factor - 1) > 1e-6}
        best = max(tried, key=lambda factor: tried[factor].score)
        if abs(best - 1) < 0.25:
            near = {
                factor: fit(looked.patches, about_z((1 - factor) * turned), _NEAR)
                for factor in (best + _NEARBY).tolist()
            }
            best = max(near, key=lambda factor: near[factor].score)
            tried[best] = by(best)
        ways = about_z((1 - best) * turned)
        yield Tried(ways, tried[best], _MORE_BY_STEPS, lambda now, then: self._steps(looked, best, now, then))

    def _direction(self, looked: Looked, now: Fit, then: Fit) -> Finding:
        if self._table_is_known:
            changes = Changes(cell={"turntable": {"direction": -self._placement.direction}})
        else:
            changes = self._angles_times(looked, -1.0)
        remedy = remedy_of("table-direction", changes)
        return codes.TABLE_DIRECTION_OF_SCANS(remedy=remedy, pairs_before=now.pairs, pairs_after=then.pairs)

    def _steps(self, looked: Looked, factor: float, now: Fit, then: Fit) -> Finding:
        remedy = remedy_of("table-angles", self._angles_times(looked, factor))
        return codes.TABLE_STEPS_OF_SCANS(
            remedy=remedy, factor=factor, pairs_before=now.pairs, pairs_after=then.pairs
        )

    def _angles_times(self, looked: Looked, factor: float) -> Changes:
        captures = self._captures(list(self._groups))
        return Changes(
            captures={c.id: {"table_deg": factor * c.table_deg} for c in captures if c.table_deg is not None}
        )

    # Poses

    def _of_poses(self, looked: Looked, seen: Patches, where: list[FloatArray]) -> Iterator[Tried]:
        captures = [self._groups[name].captures[0] for name in looked.used]
        still = [stands_still(self._session.cell, one) and not self._placement.held for one in captures]
        if any(still) or any(one.pose is None for one in captures):
            return
        rows = [capture.pose or [] for capture in captures]
        told = Reading.told(CONVENTIONS[self._session.cell.pose_convention])
        ways = [replace(told, way="inverted"), replace(told, way="transposed")]
        units = [
            replace(one, mm_per_unit=told.mm_per_unit * factor) for one in (told, *ways) for factor in (1e3, 1e-3)
        ]
        tried: list[Tried] = []
        seen_before: list[Reading] = [told]
        for reading in (*ways, *units, *readings(self._session.cell, rows)):
            if reading in seen_before or reading.mm_per_unit not in MM_PER_UNIT.values():
                continue
            seen_before.append(reading)
            try:
                poses = [reading.pose(row) for row in rows]
            except CalibrationError:
                continue
            anew = [
                self._placement.way(capture, pose).matrix for capture, pose in zip(captures, poses, strict=True)
            ]
            moves = np.array([new @ np.linalg.inv(old) for new, old in zip(anew, where, strict=True)])
            if np.abs(moves[:, :3, 3]).max() > 1e5:
                continue
            if not any(same_arrangement(moves, other.ways, seen.size_mm) for other in tried):
                tried.append(Tried(moves, fit(seen, moves), MORE, self._reading_finding(reading)))
        # Poses in a wrong unit lie on one heap, where pairs are many by chance, and as many in every such reading.
        for one in tried:
            others = [other.fit.score for other in tried if other is not one]
            if one.fit.score > _MORE_BY_STEPS * max(others, default=0.0):
                yield one

    def _reading_finding(self, reading: Reading) -> Callable[[Fit, Fit], Finding]:
        def finding(now: Fit, then: Fit) -> Finding:
            cell = self._session.cell
            remedy = remedy_of("pose-reading", changes_of(reading, cell, self._captures(list(self._groups))))
            said = reading.words(CONVENTIONS[cell.pose_convention])
            return codes.POSES_READ_OTHERWISE(
                remedy=remedy, reading=said, pairs_before=now.pairs, pairs_after=then.pairs
            )

        return finding

    # Two scans that changed places

    def _of_two(self, looked: Looked, seen: Patches, now: Fit, where: list[FloatArray]) -> Iterator[Tried]:
        patches_of = np.maximum(np.bincount(seen.scans, minlength=len(looked.used)), 1)
        suspects = [
            k
            for k in np.argsort(now.by_scan / patches_of).tolist()
            if impossible_of_scan(looked.outward, k) > _MUDDLED
        ][:_MOST_SUSPECTS]
        unmoved = np.tile(np.eye(4), (len(where), 1, 1))
        degrees = self._degrees(looked)
        for a, b in combinations(suspects, 2):
            both = unmoved.copy()
            both[a], both[b] = where[b] @ np.linalg.inv(where[a]), where[a] @ np.linalg.inv(where[b])
            yield Tried(
                both, fit(seen, both), _MORE_BY_TWO, self._swap(looked, a, b, ("pose", "poses", "table_deg"))
            )
            if degrees is None or degrees[a] == degrees[b]:
                continue
            turn = self._placement.direction * self._placement.scale * np.deg2rad(degrees[a] - degrees[b])
            turns = np.zeros(len(where))
            turns[a], turns[b] = turn, -turn
            yield Tried(
                about_z(turns), fit(seen, about_z(turns)), _MORE_BY_TWO, self._swap(looked, a, b, ("table_deg",))
            )

    def _swap(self, looked: Looked, a: int, b: int, fields: tuple[str, ...]) -> Callable[[Fit, Fit], Finding]:
        one, other = (self._groups[looked.used[k]].captures[0] for k in (a, b))

        def finding(now: Fit, then: Fit) -> Finding:
            records = {capture.id: capture.to_json() for capture in (one, other)}
            changes = {
                mine.id: {
                    field: records[theirs.id].get(field)
                    for field in fields
                    if records[theirs.id].get(field) != records[mine.id].get(field)
                }
                for mine, theirs in ((one, other), (other, one))
            }
            what = "angle" if fields == ("table_deg",) else "both" if one.table_deg is not None else "pose"
            return codes.SWAPPED_SCANS(
                [one.id, other.id],
                remedy=remedy_of("swapped-poses", Changes(captures=changes), [one.id, other.id]),
                what=what,
                pairs_before=now.pairs,
                pairs_after=then.pairs,
            )

        return finding

    # Scans elsewhere, and in metres

    def _astray(self, looked: Looked) -> list[int]:
        """Return the few scans that stand in lines of sight, while the others hardly do once these are gone.

        Such a scan pairs with little, too.
        """
        out, rest = looked.outward, list(range(len(looked.used)))
        patches = np.array([max(len(own), 1) for own in looked.patches.rows_of_scans()])
        paired = looked.overlap.per_scan[:, 0] / patches
        lonely = paired < _PAIRED * np.median(paired)
        all_of_it, found = impossible_among(out, rest), list[int]()
        while 3 * (len(found) + 1) < len(looked.used):
            worst = max(rest, key=lambda k: impossible_of_scan(out, k, rest))
            if impossible_of_scan(out, worst, rest) < _ASTRAY or not lonely[worst]:
                break
            found.append(worst)
            rest.remove(worst)
        return found if impossible_among(out, rest) < min(_WITHOUT * all_of_it, _MUDDLED) else []

    def _elsewhere(self, looked: Looked, alone: Collection[int]) -> list[Finding]:
        """Return scans that the others fit together without: beyond all of them, or in their lines of sight."""
        rows = looked.patches.rows_of_scans()
        others = np.concatenate([rows[k] for k in range(len(rows)) if k not in alone])
        low, high = looked.patches.points_mm[others].min(axis=0), looked.patches.points_mm[others].max(axis=0)
        reach = 0.5 * float(np.linalg.norm(high - low))
        found: list[str] = []
        for k in alone:
            points = looked.patches.points_mm[rows[k]]
            if not len(points):
                continue
            beyond = np.maximum(np.maximum(low - points, points - high), 0)
            apart = float(np.linalg.norm(np.median(beyond, axis=0)))
            if apart > reach or impossible_of_scan(looked.outward, k) > _ASTRAY:
                found.append(looked.used[k])
        rest = [k for k, name in enumerate(looked.used) if name not in found]
        if not found or 2 * len(found) > len(looked.used) or impossible_among(looked.outward, rest) > _RUBBLE:
            return []
        ids = [capture.id for capture in self._captures(found)]
        remedy = remedy_of("scan-elsewhere", Changes(captures={name: {"excluded": True} for name in ids}), ids)
        return [codes.SCAN_ELSEWHERE(ids, remedy=remedy)]

    def _in_metres(self, looked: Looked) -> list[Finding]:
        rows = looked.patches.rows_of_scans()
        size = looked.patches.size_mm
        across = {
            name: float(np.ptp(looked.patches.points_mm[mine], axis=0).max()) if len(mine) else 0.0
            for name, mine in zip(looked.used, rows, strict=True)
        }
        names = [*looked.used, *looked.failed]
        usual = float(np.median(list(across.values())))
        small = [name for name in names if across.get(name, 0.0) <= max(_SMALLER * usual, _LEAST_MM)]
        if not small or len(small) > _MOST_READ_AGAIN:
            return []
        extents = {name: extent_mm(self._scans[self._numbers[name]].points_in_laser_mm) for name in small}
        small = [name for name in small if 0 < extents[name] <= max(_SMALLER * usual, _LEAST_MM)]
        if not small:
            return []
        where = [float(np.linalg.norm(self._middle(name)[1].translation_mm)) for name in small]
        poses_too = max(where) < 50 * _LEAST_MM and len(small) == len(names)
        if not self._pairs_in_metres(looked, small, size, poses_too):
            return []
        captures = self._captures(small)
        settings = {c.id: {"format_settings": {**(c.format_settings or {}), "unit": "m"}} for c in captures}
        cell: dict[str, object] = {}
        if poses_too:
            told = Reading.told(CONVENTIONS[self._session.cell.pose_convention])
            longer = changes_of(replace(told, mm_per_unit=1000 * told.mm_per_unit), self._session.cell, captures)
            cell = longer.cell
            settings = {name: {**patch, **longer.captures.get(name, {})} for name, patch in settings.items()}
        ids = [capture.id for capture in captures]
        remedy = remedy_of("point-unit", Changes(cell=cell, captures=settings), ids)
        return [codes.SCANS_IN_METRES(ids, remedy=remedy, extent_mm=max(extents[name] for name in small))]

    def _pairs_in_metres(self, looked: Looked, small: Sequence[str], size: float, poses_too: bool) -> bool:
        """Return whether these scans pair with others once their points are a thousand times larger."""
        anew: list[tuple[str, SeenBy]] = []
        if len(small) == len(self._numbers):  # then the patches are as small as the scans, too
            size = max(size, PATCH_SPACINGS * 1000 * max(scan.spacing_mm for scan in self._scans))
        for name in small:
            scan = self._scans[self._numbers[name]]
            ways = scan.turntable_from_laser.copy()
            if poses_too and self._placement.base_from_turntable is None:
                ways[:, :3, 3] *= 1000
            with suppress(CalibrationError):
                points = 1000 * scan.points_in_laser_mm
                larger = replace(scan, points_in_laser_mm=points, turntable_from_laser=ways)
                anew.append((name, seen_by(clean_scan(larger), size)))
        if not anew:
            return False
        if len(small) == len(self._numbers):
            together = joined_patches(anew, size)
            return len(anew) == 1 or fit(coarse(together)).pairs >= LEAST_PAIRS
        kept = [name not in small for name in looked.used]
        rows = [mine for mine, keep in zip(looked.patches.rows_of_scans(), kept, strict=True) if keep]
        return any(pairs_with(looked.patches, rows, one, size) for one in anew)
