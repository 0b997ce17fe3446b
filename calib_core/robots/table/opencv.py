"""OpenCV's FileStorage: 4×4 matrices, or rotations and translations that belong together by their names."""

import re

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.opencv import storage_matrices
from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.messages import explained, message, sentences
from calib_core.poses.numbers import parse_pose, to_pose
from calib_core.robots.controller_file import Found, Frame, Taught
from calib_core.robots.file_hints import Told
from calib_core.robots.table.units import scale_of
from calib_core.robots.text import source_of

_OTHER_THINGS = re.compile(r"cam|target|board|laser|world2|marker|covariance|distortion|turntable", re.IGNORECASE)
_FIXED = re.compile(r"(tool0|flange|base)_from_(?!tool0$|flange$|gripper$)(\w+)", re.IGNORECASE)
_HANDS = "(?:gripper|tool0?|flange|hand|ee|effector)"
_INVERSE = re.compile(rf"base_?(?:2|to)_?{_HANDS}|{_HANDS}_from_base", re.IGNORECASE)
_CERTAIN = re.compile(rf"{_HANDS}_?(?:2|to)_?base|base_from_{_HANDS}", re.IGNORECASE)


def find(data: bytes, name: str, told: Told) -> Found:
    """Return the poses of a file; raises InputError if it is damaged or the unit is not said."""
    source = source_of(data, name)
    found = Found(name)
    matrices: list[tuple[str, FloatArray]] = []
    fixed_ones: list[tuple[bool, str, FloatArray, int]] = []
    for node, values in _whole(storage_matrices(source.text, name)).items():
        line = _line(source.text, node)
        fixed = _FIXED.fullmatch(node)
        if fixed and values.shape == (4, 4):
            fixed_ones.append((fixed[1].lower() in ("tool0", "flange"), fixed[2], values, line))
        elif _OTHER_THINGS.search(node):
            found.skip(line, message("{node}: its name is not that of the flange in the base", node=node))
        elif values.shape == (4, 4):
            matrices.append((node, values))
        else:
            found.skip(
                line,
                message(
                    "{node}: {height} × {width} numbers are no pose",
                    node=node,
                    height=values.shape[0],
                    width=values.shape[1],
                ),
            )
    scale = scale_of("matrix", told.unit or "", [m[:3, 3].tolist() for _, m in matrices], name)
    for on_flange, child, values, line in fixed_ones:  # as our own export writes them, in mm unless told otherwise
        matrix = values.copy()
        matrix[:3, 3] *= scale_of("matrix", told.unit or "mm", (), name).factor
        frame = Frame(child, child, tuple(matrix.ravel().tolist()), "matrix", line, name)
        (found.tools if on_flange else found.frames).append(frame)
    for node, values in matrices:
        matrix = values.copy()
        matrix[:3, 3] *= scale.factor
        doubt = scale.doubt
        line = _line(source.text, node)
        try:
            pose = parse_pose("matrix", matrix.ravel().tolist())
        except InputError as error:
            found.skip(line, explained(f"{node}", error))
            continue
        numbers = to_pose("matrix", pose.inverse() if _INVERSE.search(node) else pose)
        if _INVERSE.search(node):
            said = message("Turned round: the name {node} says that it is the base in the flange.", node=node)
            doubt = sentences([doubt, said])
        elif not _CERTAIN.search(node):
            said = message("Taken as the flange in the base: {node} does not say so.", node=node)
            doubt = sentences([doubt, said])
        found.poses.append(Taught(node, tuple(numbers), "matrix", line, None, file=name, doubt=doubt))
    return found


def _whole(nodes: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return 4×4 matrices where they stand as such, as 3×4, or as a rotation and a translation of like names."""
    whole: dict[str, FloatArray] = {}
    used: set[str] = set()
    for node, values in nodes.items():
        if node in used:
            continue
        if values.shape == (3, 4):
            whole[node] = np.vstack([values, [0, 0, 0, 1]])
            continue
        partner = _partner(node, nodes)
        if partner is not None:
            used.add(partner)
            rotation = values if values.shape == (3, 3) else rotation_from_vector(values.ravel())
            whole[node] = np.eye(4)
            whole[node][:3, :3], whole[node][:3, 3] = rotation, nodes[partner].ravel()
            continue
        whole[node] = values
    return {node: values for node, values in whole.items() if node not in used}


def _partner(node: str, nodes: dict[str, FloatArray]) -> str | None:
    """Return the translation that belongs to a rotation (R_… with t_…, rvec… with tvec…)."""
    for begins, belongs in (("R_", "t_"), ("R_", "T_"), ("rvec", "tvec"), ("rotation", "translation"), ("R", "t")):
        other = belongs + node[len(begins) :]
        if node.startswith(begins) and other in nodes and nodes[other].size == 3:
            return other if nodes[node].shape == (3, 3) or nodes[node].size == 3 else None
    return None


def _line(text: str, node: str) -> int:
    last = re.escape(node.rsplit(".", 1)[-1])
    match = re.search(rf"^[ \t]*(?:<{last}\b|\"?{last}\"?\s*:)", text, re.MULTILINE)
    return text.count("\n", 0, match.start() + len(match[0]) - len(match[0].lstrip())) + 1 if match else 1
