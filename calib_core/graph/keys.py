"""The graph of results: what each stage reads, its key, and what is stale.

A stage's node is known by its key: the hash of exactly what it reads, which are the fields of the cell and of its
captures that it declares, those captures' files, and the keys of the stages it rests on.  A result carries as
`inputs_sha256` the key that it was solved for, and is stale where the key is another one now.  What nobody reads
changes no key; and since a solver gets a session that holds nothing else, nothing else can change its result.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from calib_core.cell.found import ON_FLANGE
from calib_core.errors import CalibrationError, InputError
from calib_core.graph.registry import STAGES, stages
from calib_core.graph.stage import Stage
from calib_core.graph.temperature import at_temperature
from calib_core.records import Capture, Cell, ReadFile, Result, Session
from calib_core.steps import steps_that_show

_LATER = {
    "taken", "clock", "excluded_because", "included_because", "added_because", "changed_because", "environment"
}  # fmt: skip

Digest = Callable[[str], str]

_NULL_IN_KEYS = frozenset({
    "board", "robot.arm", "robot.orientation_sigma_deg", "robot.position_sigma_mm", "scanner.errors",
    "scanner.point_sigma_mm", "scanner.z_axis", "scanners", "sphere_class", "sphere_diameter_mm",
    "sphere_diameter_sigma_mm", "turntable.angle_sigma_deg", "turntable.angles", "turntable.direction",
    "turntable.encoder", f"known.{ON_FLANGE}", "known.base_from_turntable",
})  # fmt: skip
"""Fields that stood in keys as null before 2026-12, and do so for ever; any other that is not told is left out."""

_EMPTY_IS_UNTOLD = frozenset({"spheres", "sphere_distances", "axes", "known.frames", "axes_deg", "axes_mm"})
"""Fields that tell nothing where they are empty."""

_ONCE_DEFAULT: Mapping[str, object] = {"merge.voxel_mm": 0.5}
"""What stands in keys for a field that is not told, as it was its default; now the data choose."""

_ALWAYS_KEPT = ("id", "step", "kind", "files")  # without which a capture is none


class Graph:
    """The stages of one session, with their keys.

    Parameters
    ----------
    session : Session
    digest : callable
        Returns the SHA-256 of a file by its name in a capture.
    """

    def __init__(self, session: Session, digest: Digest) -> None:
        self.session = session
        self._digest = digest
        self._keys: dict[str, str] = {}
        self._first_keys: dict[str, str] = {}

    @classmethod
    def of_files(cls, session: Session, read: ReadFile) -> "Graph":
        """Return the graph of a session whose files are read to be hashed, each once."""
        digests: dict[str, str] = {}

        def digest(name: str) -> str:
            if name not in digests:
                digests[name] = hashlib.sha256(read(name)).hexdigest()
            return digests[name]

        return cls(session, digest)

    @classmethod
    def stale_of(
        cls, session: Session, read: ReadFile, results: Mapping[str, Mapping[str, Any] | Result]
    ) -> frozenset[str]:
        """Return which results of a session's stages are stale, its files being read to be hashed."""
        return cls.of_files(session, read).stale(results)

    def key(self, stage: str) -> str:
        """Return a stage's key; raises what `digest` raises, and InputError where there is no such stage."""
        if stage not in self._keys:
            self._keys[stage] = _sha256(self._inputs(STAGES.get(stage, "stage")))
        return self._keys[stage]

    def is_fresh(self, stage: str, inputs_sha256: object) -> bool:
        """Return whether a result with this hash was solved from what the session holds now.

        A file that cannot be read any more, and a stage that is unknown, make it stale.
        """
        try:
            return inputs_sha256 in (self.key(stage), self._first_key(stage))
        except CalibrationError:
            return False

    def is_of_first_release(self, stage: str, inputs_sha256: object) -> bool:
        """Return whether a result with this hash was solved by 0.1.0, from what the session holds now."""
        try:
            return inputs_sha256 == self._first_key(stage)
        except CalibrationError:
            return False

    def stale(self, results: Mapping[str, Mapping[str, Any] | Result]) -> frozenset[str]:
        """Return the stages whose results, records or their JSON data, were solved from something else."""
        hashes = {
            stage: result.inputs_sha256 if isinstance(result, Result) else result.get("inputs_sha256")
            for stage, result in results.items()
        }
        return frozenset(stage for stage, sha256 in hashes.items() if not self.is_fresh(stage, sha256))

    def lineage(self, stage: str) -> tuple[Stage, ...]:
        """Return a stage and all that it rests on in this session, brought ones too, in their order."""
        found = {stage}
        todo = [stage]
        while todo:
            here = STAGES.get(todo.pop(), "stage")
            if here.name != stage and here.is_brought(self.session):
                continue
            before = [name for name in here.rests_on(self.session) if name not in found]
            found.update(before)
            todo += before
        return tuple(other for other in stages() if other.name in found)

    def session_for(self, stage: str) -> Session:
        """Return the session with nothing but what a stage and those it rests on read: for its solver.

        Sphere and ball bar are as long as at the temperature of the stage's captures.
        """
        lineage = self.lineage(stage)
        solved = [other for other in lineage if other.name == stage or not other.is_brought(self.session)]
        fields = {name for other in solved for name in other.reads_of_cell(self.session)} | {"pose_convention"}
        brought = [other for other in lineage if other not in solved]
        fields |= {f"known.{name}" for other in brought for name in other.known}
        read: dict[str, set[str]] = {}
        for other in solved:
            for capture, names in other.reads_of_captures(self.session):
                read.setdefault(capture.id, set()).update(names)
        captures = [_only(c, {*read[c.id], *_ALWAYS_KEPT}) for c in self.session.captures if c.id in read]
        return Session.model_construct(
            _fields_set={"cell", "captures"},
            cell=_cell_with(at_temperature(self.session, STAGES.get(stage, "stage").takes).cell, fields),
            captures=captures,
        )

    def _first_key(self, stage: str) -> str:
        """Return the hash that version 0.1.0 gave the same inputs."""
        if stage not in self._first_keys:
            self._first_keys[stage] = inputs_sha256_of_0_1_0(
                self.session, STAGES.get(stage, "stage"), self._digest
            )
        return self._first_keys[stage]

    def _digest_of(self, name: str) -> str:
        try:
            return self._digest(name)
        except KeyError:
            raise InputError("the file {name}", "none", "Add it.", name, name=name) from None

    def _inputs(self, stage: Stage) -> dict[str, Any]:
        """Return all that a stage reads, as JSON data."""
        session = self.session
        if stage.is_brought(session):
            brought = _told(session.cell, (f"known.{name}" for name in stage.known))
            return {"brought": {path.removeprefix("known."): value for path, value in brought.items()}}
        read = [pair for pair in stage.reads_of_captures(session) if not pair[0].excluded]
        names = {name for capture, fields in read if "files" in fields for name in capture.files}
        names.update(stage.files_of_cell(session))
        return {
            "stage": stage.name,
            "cell": _told(at_temperature(session, stage.takes).cell, sorted(stage.reads_of_cell(session))),
            "captures": [
                {"id": capture.id, "step": capture.step}
                | {name: value for name in fields if _is_told(name, value := _plain(getattr(capture, name)))}
                for capture, fields in read
            ],
            "files": {name: self._digest_of(name) for name in sorted(names)},
            "after": {name: self.key(name) for name in stage.rests_on(session)},
        }


def stage_captures(session: Session, stage: str) -> list[Capture]:
    """Return the captures that a stage takes, the excluded ones too."""
    steps = STAGES.get(stage, "stage").steps
    return [capture for capture in session.captures if capture.step in steps]


def inputs_sha256(session: Session, stage: str, read: ReadFile) -> str:
    """Return a stage's key, the hash of all that its result depends on."""
    return Graph.of_files(session, read).key(stage)


def _sha256(data: Any) -> str:
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _told(cell: Cell, paths: Iterable[str]) -> dict[str, Any]:
    """Return the cell's fields at dotted names as JSON data, without those that are not told."""
    found = {path: _value(cell, path) for path in paths}
    values = {path: _ONCE_DEFAULT.get(path) if value is None else value for path, value in found.items()}
    return {path: value for path, value in values.items() if _is_told(path, value) or path in _NULL_IN_KEYS}


def _is_told(path: str, value: Any) -> bool:
    return bool(value) if path in _EMPTY_IS_UNTOLD else value is not None


def _value(record: Any, path: str) -> Any:
    """Return what stands at a dotted name in a record, as JSON data."""
    for name in path.split("."):
        record = getattr(record, name)
    return _plain(record)


def _plain(value: Any) -> Any:
    """Return a field's value as JSON data, without what stands at its default."""
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json", exclude_defaults=True)
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list):
        return [_plain(item) for item in value]  # pyright: ignore[reportUnknownVariableType]
    return value


def _only(capture: Capture, fields: Iterable[str]) -> Capture:
    """Return a capture with these of its fields alone."""
    kept = {name: getattr(capture, name) for name in fields if name in capture.model_fields_set}
    return Capture.model_construct(_fields_set=set(kept), **kept)


def _cell_with(cell: Cell, paths: Iterable[str]) -> Cell:
    """Return a cell with these of its fields alone, given by dotted names; all others stand at their defaults."""
    kept: dict[str, Any] = {}
    parts: dict[str, dict[str, Any]] = {}
    for path in paths:
        name, _, inner = path.partition(".")
        if name not in cell.model_fields_set:
            continue
        value = getattr(cell, name)
        if not inner:
            kept[name] = value
        elif inner in value.model_fields_set:
            parts.setdefault(name, {})[inner] = getattr(value, inner)
    for name, fields in parts.items():
        kept[name] = type(getattr(cell, name)).model_construct(_fields_set=set(fields), **fields)
    return Cell.model_construct(_fields_set=set(kept), **kept)


def inputs_sha256_of_0_1_0(session: Session, stage: Stage, digest: Callable[[str], str]) -> str:
    """Return the hash over the whole cell and the whole captures of a stage and of those it rests on.

    It is kept for the results of that version alone: nothing new is ever marked with it.
    """
    steps = {*stage.steps}
    boards = steps_that_show("board")
    if not stage.needs_every_step:
        before = [STAGES.get(name) for name in stage.after]
        steps |= {
            other.step.name
            for other in before
            if other.step and other.step.name not in boards and not other.is_brought(session)
        }
    captures = [capture for capture in session.captures if capture.step in steps]
    if stage.after and any(capture.kind in ("frame", "sweep") for capture in captures):
        steps |= {*boards}
        captures = [capture for capture in session.captures if capture.step in steps]
    names = [name for capture in captures if not capture.excluded for name in capture.files]
    inputs = {
        "stage": stage.name,
        "cell": session.cell.model_dump(mode="json", exclude_defaults=True, exclude={"findings"}),
        "captures": [
            capture.model_dump(mode="json", exclude_defaults=True, exclude=_LATER) for capture in captures
        ],
        "files": {name: digest(name) for name in names},
    }
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()
