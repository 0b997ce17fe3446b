"""What the core and the scene can say to a page, read from their code: templates, with {} for what changes.

Of parts that speak in sentences, every sentence of theirs counts. Of parts that write files as well, only refusals
count: what is given to the error type, see `refusal_texts`.
"""

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import product
from pathlib import Path

from calib_core.exports.registry import all_exports
from calib_core.formats.points import FORMATS
from server.movers.registry import MOVERS
from server.sources.registry import SOURCES
from tests.web.refusal_texts import given_to_errors, refusers

ROOT = Path(__file__).resolve().parents[2]
_CORE = (
    "captures",
    "causes",
    "chain",
    "evidence",
    "formats",
    "fusion",
    "graph",
    "guidance",
    "optics",
    "review",
    "sphere",
    "stages",
)
_REFUSING: tuple[str, ...] = (
    "calib_core/archive",
    "calib_core/arms",
    "calib_core/clock_offset.py",
    "calib_core/estimation.py",
    "calib_core/exports",
    "calib_core/formats",
    "calib_core/frame_graph.py",
    "calib_core/frames.py",
    "calib_core/pose_track.py",
    "calib_core/poses",
    "calib_core/records",
    "calib_core/registry.py",
    "calib_core/robots",
    "calib_core/simulation",
    "server/auth/middleware.py",
    "server/auth/refusals.py",
    "server/auth/logins.py",
    "server/captures",
    "server/http",
    "server/jobs",
    "server/live",
    "server/measuring.py",
    "server/movers",
    "server/render",
    "server/routes",
    "server/scenes",
    "server/sources",
    *(
        f"server/store/{name}.py"
        for name in (
            "answers",
            "archived_history",
            "archives",
            "blobs",
            "capture_writes",
            "captures",
            "devices",
            "history",
            "paging",
            "releases",
            "retention",
            "sessions",
            "solves",
            "store_lock",
            "tokens",
            "webhooks",
        )
    ),
)
"""Folders and files whose refusals a page shows; their other texts can be contents of files that they write."""
_ROBOTS = ("joint_check", "phrases", "read_back", "resolve")
_LIVE = ("armed_table", "clock_watch", "exposures", "link", "pictures", "plausibility", "standstill")
_SCENE = (
    "answers",
    "deviation",
    "ghost",
    "layers",
    "legend",
    "optics",
    "scene_model",
    "turntable_layers",
    "views",
)
_NOT_CHOSEN = {"folder", "simulated"}
"""Sources without a form in the page."""
_OTHER_MEDIA = {"html.py", "style.py", "svg.py", "text.py"}
"""Reports of their own, in English."""
_LEAST_WORDS = 3
_HAS_WORDS = re.compile(r"[A-Za-z]{2,}[ .]|[ .][A-Za-z]{2,}")
_JOINS = {"MB", "and", "as", "for", "in", "mm", "of"}

NOT_SHOWN = {
    "results/{}.json: workpiece",
    "captures are to be named in ascending order, each once",
    "nothing is free; use fit_poses",
    "a stage that rests on '{}' was started without it",
    "cell.{} is no record",
    # Contents of files, and what only writers of files and of plugins see.
    "# .PCD v0.7 - Point Cloud Data file format",
    "comment unit mm",
    "format binary_little_endian 1.0",
    "property list uchar int vertex_indices",
    "in inch inches zoll",
    "m meter metre meters metres",
    "mm millimeter millimetre millimeters millimetres",
    "um µm μm micron microns micrometer micrometre micrometers micrometres",
    "x_mm,z_mm or x,y,z",
    "the entry point '{}' of '{}' is no {}",
    "two entries named '{}' in {} and {}",
    # The page says in its own words what was read.
    "by the format",
    "stated in the file",
    # The page has its own words for these settings.
    "A named arm: the flange by its joints.",
    "A named arm, where joints alone are told.",
    "Check the certificate; false for the controller's own.",
    # Why a file is taken for one format: `scancell read` says it.
    "begins like an image",
    "begins like one",
    "begins with 'ply'",
    "begins with 'solid'",
    "begins with ASTM-E57",
    "begins with LASF",
    "begins with the section {}",
    "has a PCD header",
    "has the size of {} triangles",
    "is an image",
    "is an image of 16 bit",
    "is too wide for points",
    "its first line counts along x",
    "its name ends in {}",
    "whole numbers with −2147483648 where nothing came back",
    # Arrays and cameras of a notebook: no page gives them.
    "Give fx 0 cx / 0 fy cy / 0 0 1 in pixels.",
    "Give one for each.",
    "Give one point a row.",
    "Give the arrays of one scan together.",
    "Give the segments that the calibration found.",
    "Give them in OpenCV's order: {}.",
    "Leave camera_from_laser out; it follows from the plane.",
    "Make both grids alike.",
    "NaN or infinity",
    "Reshape the scan.",
    "Check the points' sigmas.",
    "Use OpenCV's names; the tilts are tauX and tauY in rad.",
    "a camera matrix of 3×3 numbers with positive focal lengths",
    "a camera_from_laser whose y axis is the plane's normal and whose origin lies in the plane",
    "a grid of the same voxels",
    "a plane's normal of three finite numbers and its distance",
    "a scan of profiles × columns × 3 numbers",
    "a {} as an array of N rows and {} columns",
    "at least two bands of depth for a segmental camera, and none for another",
    "distortion coefficients among {}",
    "model '{}' with {} bands",
    "one that is off the plane",
    "poses, weights and normals for {}×{} points",
    "rows of points (P, C, 3)",
    "shapes {}, {} and {}: a scan of another size",
    "the errors of {} scans",
    "the plane of light, or a depth, for a camera whose distortion changes with depth",
    "up to 14 finite distortion coefficients",
}
"""Sentences that no page can show."""


def said_to_pages() -> set[str]:
    """Return the sentences that a page can show."""
    files = [file for file in _core() if file.name not in _OTHER_MEDIA]
    scene = [ROOT / "server" / "scenes" / f"{name}.py" for name in _SCENE]
    sentences = {one for file in [*files, *scene] for one in templates(file) if _is_sentence(one)}
    return (sentences | refusals()) - NOT_SHOWN


def refusals() -> set[str]:
    """Return what the refusing parts give to the error type: need, got and what to do."""
    return {
        one
        for file in _refusing()
        for node in given_to_errors(_parsed(file), _refusers())
        for one in _templates_of(_variants(node) or [])
        if _HAS_WORDS.search(one.replace("{}", "")) and not _says_nothing(one)
    }


def _says_nothing(text: str) -> bool:
    """Whether it is a name, a number with its unit, or holes joined by a word, which the page takes apart."""
    words = re.findall(r"[A-Za-z]+", text)
    return re.fullmatch(r"[\w./]+", text) is not None or set(words) <= _JOINS


def names() -> set[str]:
    """Return how formats, exports, sources and tables are called, and what is said of their settings."""
    entries = [*FORMATS, *all_exports(), *SOURCES, *MOVERS]
    titles = {re.sub(r"^.*(?=: check move$)", "{}", one.title) for one in entries}
    settings = [one.describe()["settings"] for one in [*SOURCES, *MOVERS] if one.name not in _NOT_CHOSEN]
    described = [field.get("description") for one in settings for field in one["properties"].values()]
    return titles | {one for one in described if one}


def told() -> set[str]:
    """Return every text of the core's parts that speak, of the scene, and of the registries."""
    files = [*_core(), *_refusing(), *(ROOT / "server" / "scenes").glob("*.py"), ROOT / "calib_core" / "errors.py"]
    return names().union(*(templates(file) for file in files))


def _core() -> list[Path]:
    files = [file for name in _CORE for file in (ROOT / "calib_core" / name).rglob("*.py")]
    files += [ROOT / "calib_core" / "robots" / f"{name}.py" for name in _ROBOTS]
    files.append(ROOT / "calib_core" / "poses" / "identity.py")
    files += [ROOT / "server" / "live" / f"{name}.py" for name in _LIVE]
    return [
        file for file in files if file != ROOT / "calib_core" / "review" / "compare.py"
    ]  # the page has its words


def _refusing() -> list[Path]:
    places = [ROOT / name for name in _REFUSING]
    return [file for place in places for file in ([place] if place.is_file() else place.rglob("*.py"))]


@cache
def _refusers() -> frozenset[str]:
    """Return the names of functions that make an error of what they are given, in the parts that refuse."""
    return frozenset(name for file in _refusing() for name in refusers(_parsed(file)))


def _is_sentence(text: str) -> bool:
    words = re.findall(r"[A-Za-z]{2,}", text.replace("{}", " "))
    return len(words) >= _LEAST_WORDS and " " in text.strip() and not re.search(r"\w\[|\|", text)


@cache
def _parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def templates(file: Path) -> frozenset[str]:
    """Return every text in a file's code, without docstrings; of HTML what stands between its tags."""
    return frozenset(_templates_of(_texts(_parsed(file))))


def _templates_of(texts: Iterable[str]) -> set[str]:
    found: set[str] = set()
    for text in texts:
        plain = re.sub(r"\{[a-z_]+(?::[^{}]*)?\}", "{}", text)
        found |= set(re.split(r"<[^>]*>", plain)) if "<" in plain else {plain}
    return found


def _texts(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return  # a docstring
    variants = _variants(node)
    if variants is not None:
        yield from variants
        for hole in _holes(node):
            yield from _texts(hole)
        return
    for child in ast.iter_child_nodes(node):
        yield from _texts(child)


def _variants(node: ast.AST) -> list[str] | None:
    """Return what a text can be: a choice between two constants makes two of it, everything else is {}."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=parts):
            pieces = [[str(p.value)] if isinstance(p, ast.Constant) else _choices(p) for p in parts]
            return ["".join(one) for one in product(*pieces)]
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            first, second = _variants(left), _variants(right)
            if first is None and second is None:
                return None
            return [a + b for a, b in product(first or _choices(left), second or _choices(right))]
        case _:
            return None


def _choices(part: ast.AST) -> list[str]:
    value = part.value if isinstance(part, ast.FormattedValue) else part
    if isinstance(value, ast.IfExp):
        first, second = _variants(value.body), _variants(value.orelse)
        if first is not None and second is not None:
            return [*first, *second]
    return ["{}"]


def _holes(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.JoinedStr):
        yield from (part.value for part in node.values if isinstance(part, ast.FormattedValue))
    elif isinstance(node, ast.BinOp):
        for side in (node.left, node.right):
            if _variants(side) is None:
                yield side
            else:
                yield from _holes(side)
