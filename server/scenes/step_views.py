"""What the scene shows of a step: the layers and the view that tell its story, each page its own."""

from dataclasses import dataclass
from typing import Literal

from server.scenes.layers import LAYERS
from server.scenes.scene_model import SceneFacts

Side = Literal["measure", "result"]


@dataclass(frozen=True)
class Story:
    """The view in which a step is told, the layers that are shown, and those of them that it is about."""

    view: str
    layers: frozenset[str]
    subject: frozenset[str]


def _story(view: str, subject: str, beside: str = "") -> Story:
    about = frozenset(subject.split())
    return Story(view, about | frozenset(beside.split()), about)


# By what a step's captures show, while measuring and at the result.
_STORIES: dict[tuple[str, Side], Story] = {
    ("board", "measure"): _story("Camera", "camera boards plane"),
    ("board", "result"): _story("Camera", "camera boards plane"),
    ("sphere", "measure"): _story(
        "Captures", "frames light sphere so-far ghost trial live", "arm labels points uncertainty base"
    ),
    ("sphere", "result"): _story("Sphere", "sphere points uncertainty"),
    ("sphere-on-table", "measure"): _story(
        "Axes", "table table-so-far circles places live", "ghost turned uncertainty frames points"
    ),
    ("sphere-on-table", "result"): _story("Axes", "table circles places", "points turned uncertainty field"),
    ("object", "measure"): _story("Axes", "table scans live", "turned"),
    ("object", "result"): _story("Object", "scans"),
    ("answers", "result"): _story("Answers", "answers"),
}
_SCANNED = _story("Object", "scans live", "table turned")
_WHOLE = Story("Captures", frozenset(LAYERS), frozenset(LAYERS))


def story(shows: str, side: Side, facts: SceneFacts) -> Story:
    """Return the story of a step by what its captures show; before there is anything to tell, everything is shown.

    A result whose sphere, table, boards or cloud is not known yet is told like its captures.
    """
    known = {
        "board": facts.optics is not None,
        "sphere": side == "measure" or facts.sphere_center_in_base_mm is not None,
        "sphere-on-table": facts.table is not None or (side == "measure" and facts.table_so_far is not None),
        "answers": bool(facts.compared),
        "object": facts.merged is not None if side == "result" else facts.table is not None,
    }
    if shows == "object" and side == "measure" and facts.merged is not None:
        return _SCANNED
    if known.get(shows, False):
        return _STORIES[shows, side]
    return _STORIES["sphere", "measure"] if facts.captures else _WHOLE
