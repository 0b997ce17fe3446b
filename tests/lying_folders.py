"""Twelve folders of one cell as programs leave them: profiles and poses in the forms that are met."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib_core.robots import parse_pose, to_pose
from calib_core.simulation import simulate

Files = dict[str, str | bytes]
MADE = simulate("tcp", 7)
CAPTURES = MADE.session.captures
CONTENT = [MADE.files[capture.files[0]] for capture in CAPTURES]
MATRICES = [parse_pose("abb", capture.pose or []) for capture in CAPTURES]
COUNT = len(CAPTURES)
DIAMETER_MM = 40.0
SPHERE = json.dumps({"CalibObj": {"Name": "Sphere", "Radius": DIAMETER_MM / 2}, "HTM": np.eye(4).tolist()})
JUNK: Files = {"notes.txt": "first try, cable loose\n", "empty.csv": "", ".DS_Store": b"\0\0\0\1Bud1"}
HEAD = "name,X,Y,Z,A,B,C\n"


@dataclass(frozen=True)
class Lying:
    """A folder's files, the convention of its poses, and of which capture (from 0) each measurement is."""

    convention: str
    files: Files
    measurements: dict[str, int]

    def lay(self, folder: Path) -> Path:
        return lay(folder, self.files)


def lay(folder: Path, files: Files) -> Path:
    """Write files below a folder."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def in_convention(name: str) -> list[list[float]]:
    return [to_pose(name, pose) for pose in MATRICES]


def lines(rows: list[list[float]], separator: str = " ") -> str:
    return "".join(separator.join(f"{v:.6f}" for v in row) + "\n" for row in rows)


def as_yaml(content: bytes, key: str = "scan_line") -> str:
    return f"%YAML:1.0\n---\n{key}: [ {', '.join(_flat(content))} ]\n"


def _flat(content: bytes) -> list[str]:
    rows = [line.split(",") for line in content.decode().splitlines()[1:]]
    return [f"{float(x):.8e}, 0., {float(z):.8e}" for x, z, *_ in rows if x and z]


def _as_xml(content: bytes) -> str:
    rows = _flat(content)
    data = " ".join(rows).replace(",", "")
    shape = f"<rows>{len(rows)}</rows><cols>3</cols><dt>d</dt>"
    line = f'<line type_id="opencv-matrix">{shape}<data>{data}</data></line>'
    return f'<?xml version="1.0"?>\n<opencv_storage>\n{line}\n</opencv_storage>\n'


def _lying(convention: str, poses: Files, names: list[str], form: Callable[[bytes], str | bytes] = bytes) -> Lying:
    made = {name: form(content) for name, content in zip(names, CONTENT, strict=True)}
    return Lying(convention, {**made, **poses}, {name: k for k, name in enumerate(names)})


def folders() -> dict[str, Lying]:
    """Return the folders by what is special about each."""
    numbered = [f"p{k}.csv" for k in range(1, COUNT + 1)]
    yaml = [f"p{k}.yml" for k in range(1, COUNT + 1)]
    scans = [f"scan_{k}.csv" for k in range(1, COUNT + 1)]
    stamps = [f"2024-05-01_10-{k:02d}-30" for k in range(COUNT)]
    kuka, fanuc = in_convention("kuka"), in_convention("fanuc")
    mixed = np.random.default_rng(3).permutation(COUNT).tolist()
    half = COUNT // 2
    by_name = HEAD + "".join(f"{scans[k]},{lines([kuka[k]], ',')}" for k in mixed)
    by_time = HEAD + "".join(f"{stamps[k][:-2]}29,{lines([kuka[k]], ',')}" for k in mixed)
    by_number = "".join(f"{k + 1} {lines([kuka[k]])}" for k in range(COUNT))
    halves = [f"{'a' if k < half else 'b'}/{name}" for k, name in enumerate(scans)]
    beside: Files = {f"scan_{k}.txt": lines([row]) for k, row in enumerate(kuka, start=1)}
    matrices = "%YAML:1.0\n---\n" + "".join(_matrix(k, pose.matrix) for k, pose in enumerate(MATRICES, start=1))
    pose_json = json.dumps({"P": fanuc})
    by_commas = lines(kuka, "; ").replace(".", ",")
    found = {
        "KUKA's program": _lying("kuka", {"measure.dat": _dat(kuka)}, numbered),
        "ABB's module": _lying("abb", {"Measure.mod": _module()}, numbered),
        "FANUC's program, lists in YAML": _lying("fanuc", {"calib_sph.ls": _program(fanuc)}, yaml, as_yaml),
        "a text twice, a sphere's settings, junk": _lying(
            "fanuc", {"Robot.txt": lines(fanuc), "r.rob": pose_json, "set.sec": SPHERE, **JUNK}, yaml, as_yaml
        ),
        "OpenCV's XML": _lying("fanuc", {"Robot.txt": lines(fanuc)}, [f"p{k}.xml" for k in range(COUNT)], _as_xml),
        "poses as matrices": _lying("matrix", {"poses.yml": matrices}, numbered),
        "by name": _lying("kuka", {"poses.csv": by_name}, scans),
        "by number, one missing": _lying("kuka", {"poses.txt": by_number}, scans),
        "by time": _lying("kuka", {"log.csv": by_time}, [f"{stamp}.csv" for stamp in stamps]),
        "in two folders": _lying(
            "kuka", {"a/poses.txt": lines(kuka[:half]), "b/poses.txt": lines(kuka[half:])}, halves
        ),
        "each beside its pose": _lying("kuka", beside, scans),
        "by order, decimal commas": _lying("kuka", {"list": by_commas}, scans),
    }
    missing = found["by number, one missing"]
    del missing.files[scans[3]], missing.measurements[scans[3]]
    return found


def _matrix(number: int, matrix: np.ndarray) -> str:
    data = ", ".join(f"{v:.10g}" for v in matrix.ravel())
    return f"pose{number}: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [ {data} ]\n"


def _dat(poses: list[list[float]]) -> str:
    text = ["DEFDAT MEASURE"]
    for number, pose in enumerate(poses, start=1):
        fields = ",".join(f"{name} {value!r}" for name, value in zip("XYZABC", pose, strict=True))
        text.append(f"DECL E6POS XP{number}={{{fields},S 2,T 3,E1 0.0}}")
        text.append(f'DECL FDAT FP{number}={{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}}')
    return "\n".join([*text, "ENDDAT", ""])


def _module() -> str:
    text = ["MODULE Measure"]
    for number, pose in enumerate(in_convention("abb"), start=1):
        place, turn = (",".join(f"{v:.9g}" for v in part) for part in (pose[:3], pose[3:]))
        axes = "[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]"
        text.append(f"  CONST robtarget p{number}:=[[{place}],[{turn}],{axes}];")
    text += ["  PROC main()", *(f"    MoveL p{k},v100,fine,tool0;" for k in range(1, COUNT + 1)), "  ENDPROC"]
    return "\n".join([*text, "ENDMODULE", ""])


def _program(poses: list[list[float]]) -> str:
    moves = [f"   {k}:L P[{k}] 100mm/sec FINE    ;" for k in range(1, COUNT + 1)]
    text = ["/PROG  CALIB_SPH", "/ATTR", "/MN", *moves, "/POS"]
    for number, pose in enumerate(poses, start=1):
        x, y, z, w, p, r = (f"{value:.3f}" for value in pose)
        text += [f"P[{number}]{{", "   GP1:", "\tUF : 0, UT : 0,\tCONFIG : 'N U T, 0, 0, 0',"]
        text += [f"\tX = {x}  mm,\tY = {y}  mm,\tZ = {z}  mm,"]
        text += [f"\tW = {w} deg,\tP = {p} deg,\tR = {r} deg", "};"]
    return "\n".join([*text, "/END", ""])
