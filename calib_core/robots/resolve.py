"""From poses of a tool in a frame to poses of the flange in the base, by tools and frames of the same backup."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.messages import explained, message, sentences, templates
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.robots.brand import Brand
from calib_core.robots.controller_file import ControllerFile, FilePose, Found, Frame, Reference, Skipped, Taught
from calib_core.robots.phrases import changed


def resolved(brand: Brand, found: Sequence[Found], as_written: bool = False) -> ControllerFile:
    """Return what a brand's files hold, tools and frames applied where one of the files defines them.

    Parameters
    ----------
    brand : Brand
    found : sequence of Found
        What its reader found, one entry a file.
    as_written : bool
        Take poses as they stand although a tool or a frame is unknown: the caller has been asked.
    """
    skipped = [row for part in found for row in part.skipped]
    tools = _unequivocal("tool", [tool for part in found for tool in part.tools], skipped)
    frames = _unequivocal("frame", [frame for part in found for frame in part.frames], skipped)
    for what, kept in (("tool", tools), ("frame", frames)):
        _doubt_changed(what, kept, found)
    poses: list[FilePose] = []
    for taught in _without_doubles(_settled(found), skipped):
        try:
            poses.append(_flange(brand, taught, tools, frames, as_written))
        except InputError as error:
            reason = explained(
                taught.name,
                message("{got}. {to_do}", got=error.got, to_do=error.to_do) if not error.need else error,
            )
            skipped.append(Skipped(taught.line, reason, taught.file))
    skipped += _nowhere(brand, found)
    skipped.sort(key=lambda row: (row.file, row.line))
    notes = dict.fromkeys(note for part in found for note in part.notes)
    return ControllerFile(
        brand.name,
        tuple(poses),
        tuple(tools.values()),
        tuple(frames.values()),
        tuple(skipped),
        tuple(notes),
        tuple(part.file for part in found),
        brand.proof,
    )


UNSAID = {
    "tool": message("The file does not say with which tool it was taught: make sure that it is of the flange."),
    "frame": message(
        "The file does not say with which frame it was taught: make sure that it is in the robot's base."
    ),
}
"""What is left open about a pose whose tool or frame no file says."""

_ACTIVE = templates({
    "tool": "No program says with which tool it was taught: the one active in the backup, {active}, is taken.",
    "frame": "No program says with which frame it was taught: the one active in the backup, {active}, is taken.",
})  # fmt: skip
_CHANGED = templates({
    "tool": "A program changes tool {number} in line {line}: here it may be another.",
    "frame": "A program changes frame {number} in line {line}: here it may be another.",
})  # fmt: skip
_NAMED = templates({"tool": "tool {number}", "frame": "frame {number}"})
_TAKEN = templates({
    "tool": "Taken as written, with tool {number}, which the file does not define.",
    "frame": "Taken as written, with frame {number}, which the file does not define.",
})  # fmt: skip
_UNDEFINED = templates({
    "tool": "taught with tool {number}, which the file does not define",
    "frame": "taught with frame {number}, which the file does not define",
})  # fmt: skip


def _nowhere(brand: Brand, found: Sequence[Found]) -> Iterator[Skipped]:
    """Yield the named positions that moves go to and none of the files holds."""
    known = {name for part in found for name in part.unread}
    known |= {taught.name.lower() for part in found for taught in part.poses}
    for part in found:
        for key, (name, line) in part.wanted.items():
            if key not in known:
                reason = message(
                    "{name}: a move goes there, but none of the files says where it is. Give {points}.",
                    name=name,
                    points=brand.points,
                )
                yield Skipped(line, reason, part.file)


def _settled(found: Sequence[Found]) -> Iterable[Taught]:
    """Yield every pose with the tools and frames that moves use it with, once for each pair."""
    moves: dict[str, set[tuple[Reference | None, Reference | None]]] = {}
    for part in found:
        for name, pairs in part.moves.items():
            moves.setdefault(name, set()).update(pairs)
    tool, frame = (_only({getattr(part, f"active_{what}") for part in found}) for what in ("tool", "frame"))
    points = {(_beside(part.file), name): line for part in found for (what, name), line in part.changed.items()
              if what == "point"}  # fmt: skip
    for part in found:
        for taught in part.poses:
            if line := points.get((_beside(part.file), taught.name.lower())):
                taught = replace(taught, doubt=sentences([taught.doubt or "", changed(line)]))
            pairs = moves.get(taught.name.lower())
            if taught.tool is not None:
                yield taught
            elif pairs:
                for own_tool, own_frame in sorted(pairs, key=str):
                    yield replace(taught, tool=own_tool, frame=taught.frame if own_frame is None else own_frame)
            else:
                yield _as_saved(_as_saved(taught, "tool", tool), "frame", frame)


def _beside(file: str) -> str:
    """Return what a program and its list of points have in common: their name without the ending."""
    return file.rpartition(".")[0].lower()


def _doubt_changed(what: str, kept: dict[str, Frame], found: Sequence[Found]) -> None:
    """Say of tools or frames that a program changes them: with which numbers, no file says."""
    for part in found:
        for (kind, number), line in part.changed.items():
            entry = kept.get(_key(number))
            if kind == what and entry is not None and not entry.doubt:
                doubt = message(_CHANGED[what], number=entry.number, line=f"{line} ({part.file})")
                kept[_key(number)] = replace(entry, doubt=doubt)


def _only(saved: set[Reference | None]) -> Reference | None:
    """Return the one that the files agree on."""
    known = saved - {None}
    return next(iter(known)) if len(known) == 1 else None


def _as_saved(taught: Taught, what: str, active: Reference | None) -> Taught:
    """Return a pose with the backup's active tool or frame, where no program says which it was."""
    if active is None or taught.numbers is None or getattr(taught, what) is not None:
        return taught
    said = message(_ACTIVE[what], active=active)
    return replace(taught, **{what: active}, doubt=sentences([taught.doubt or "", said or ""]))


def _unequivocal(what: str, entries: Sequence[Frame], skipped: list[Skipped]) -> dict[str, Frame]:
    """Return tools or frames by their number; those that are defined twice in two ways are left out, aloud."""
    kept: dict[str, Frame] = {}
    contradicted: set[str] = set()
    for entry in entries:
        key = _key(entry.number, entry.group)
        if key in contradicted:
            skipped.append(
                Skipped(
                    entry.line,
                    message("{what} {number} is defined again", what=what, number=entry.number),
                    entry.file,
                )
            )
            continue
        try:
            parse_pose(entry.convention, entry.pose)
        except InputError as error:
            skipped.append(Skipped(entry.line, f"{what} {entry.number}: {error}", entry.file))
            contradicted.add(key)
            kept.pop(key, None)
            continue
        before = kept.setdefault(key, entry)
        same = (before.pose, before.moving) == (entry.pose, entry.moving)
        if not same and before.by_program != entry.by_program:
            kept[key], other = (before, entry) if entry.by_program else (entry, before)
            numbers = ", ".join(f"{v:g}" for v in other.pose)
            reason = message(
                "{what} {number}: a program sets {numbers}; the controller's state is taken instead",
                what=what,
                number=other.number,
                numbers=numbers,
            )
            skipped.append(Skipped(other.line, reason, other.file))
        elif not same:
            reason = message(
                "{what} {number} is defined in two ways, here and in line {line}: neither is taken",
                what=what,
                number=entry.number,
                line=before.line if before.file == entry.file else f"{before.line} ({before.file})",
            )
            skipped.append(Skipped(entry.line, reason, entry.file))
            contradicted.add(key)
            del kept[key]
    return kept


def _without_doubles(poses: Iterable[Taught], skipped: list[Skipped]) -> list[Taught]:
    """Return the poses; of names that stand twice in one file with other numbers, none."""
    by_name: dict[tuple[str, str, str, str], list[Taught]] = {}
    for taught in poses:
        by_name.setdefault((taught.file, taught.name.lower(), str(taught.tool), str(taught.frame)), []).append(
            taught
        )
    kept: list[Taught] = []
    for same in by_name.values():
        first = same[0]
        others = [t for t in same if (t.numbers, t.joints_deg) != (first.numbers, first.joints_deg)]
        if others:
            lines = ", ".join(str(t.line) for t in same)
            reason = message(
                "{first} stands there several times with other numbers (lines {lines}): none is taken",
                first=first.name,
                lines=lines,
            )
            skipped += [Skipped(t.line, reason, t.file) for t in same]
        else:
            kept.append(first)
    return kept


def _flange(
    brand: Brand, taught: Taught, tools: dict[str, Frame], frames: dict[str, Frame], as_written: bool
) -> FilePose:
    if taught.refused and not as_written:
        raise InputError("", taught.refused, "It is not taken.")
    numbers, doubt = taught.numbers, taught.doubt
    if numbers is not None:
        written = parse_pose(taught.convention, numbers)
        pose, open_points = _applied(brand, taught, written, tools, frames, as_written)
        doubt = sentences([doubt or "", open_points or ""])
        if pose is not written:
            numbers = tuple(v + 0.0 for v in to_pose(taught.convention, pose))  # no -0.0
    return FilePose(
        taught.name, numbers, taught.convention, taught.joints_deg, taught.external, taught.tool, taught.frame,
        taught.line, taught.file, taught.numbers, doubt, taught.time_s, taught.configuration,
    )  # fmt: skip


def _applied(
    brand: Brand,
    taught: Taught,
    written: RigidTransform,
    tools: dict[str, Frame],
    frames: dict[str, Frame],
    as_written: bool,
) -> tuple[RigidTransform, str]:
    """Return base_from_tool0, and what is left open about it."""
    pose = written
    tool, of_tool = _looked_up(brand, "tool", taught.tool, tools, as_written)
    frame, of_frame = _looked_up(brand, "frame", taught.frame, frames, as_written)
    if frame is not None:
        pose = RigidTransform(parse_pose(frame.convention, frame.pose).matrix @ pose.matrix, "base", "tool0")
    if tool is not None:
        tool0_from_tool = parse_pose(tool.convention, tool.pose)
        pose = RigidTransform(pose.matrix @ tool0_from_tool.inverse().matrix, "base", "tool0")
    return pose, sentences([of_tool or "", of_frame or ""])


def _looked_up(
    brand: Brand, what: str, number: Reference | None, known: dict[str, Frame], as_written: bool
) -> tuple[Frame | None, str]:
    """Return the tool or frame to apply, None where there is nothing to apply, and what is left open."""
    plain = brand.flange if what == "tool" else brand.base
    if number is None:
        return None, UNSAID[what]
    entry = known.get(_key(number))
    if entry is not None:
        if entry.moving and not as_written:
            raise InputError(
                "",
                explained(message(_NAMED[what], number=number), entry.moving),
                "Such poses are not supported yet.",
            )
        stands_there = np.array_equal(parse_pose(entry.convention, entry.pose).matrix, np.eye(4))
        return None if stands_there else entry, entry.doubt
    if str(number).lower() in plain:
        return None, brand.doubt(what, number)
    if as_written:
        return None, message(_TAKEN[what], number=number)
    if what == "frame" and not brand.frames_settled:
        got = "taught after {number}, and which way round that works is not settled for all controllers"
        raise InputError("", got, "Record the flange in the base, without it.", number=number)
    to_do = "Give the file that defines it as well ({definitions}), or record the flange in the base."
    raise InputError("", _UNDEFINED[what], to_do, number=number, definitions=brand.definitions)


def _key(number: Reference, group: int = 1) -> str:
    return f"{group}:{str(number).lower()}"
