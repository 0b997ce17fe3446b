"""Files of points after the forms of public ones: what each truly holds, and whether it must be asked."""

import io
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import laspy
import numpy as np
from laspy.vlrs.vlr import VLR
from numpy.typing import NDArray

from tests.core.scanner_files import cloud_of, known, profile, surface

Floats = NDArray[Any]
PROFILE: Floats = known(profile())
CLOUD: Floats = known(cloud_of(*surface()))
MM = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "µm": 0.001, "inch": 25.4}
WRITTEN = {"mm": ".4f", "m": ".7f", "cm": ".5f", "µm": ".1f", "inch": ".7f"}
NORMALS: Floats = np.tile([0.6, 0.0, 0.8], (len(CLOUD), 1))


@dataclass(frozen=True)
class Form:
    """A file, what it holds in mm, and whether its reader has to doubt it: nothing in it says what is what."""

    what: str
    name: str
    data: bytes
    truth_mm: Floats
    asked: bool = False
    settings: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def kind(self) -> Any:
        """What a capture of it is."""
        return "profile" if self.truth_mm.shape[1] == 2 else "cloud"


def rows(columns: Sequence[Floats], separator: str, form: str = ".4f") -> str:
    """Lines of columns (N,) or (N, K); whole ones without decimals."""
    table = np.column_stack(columns)
    whole = (table == np.round(table)).all(axis=0)
    return "".join(
        separator.join(f"{v:.0f}" if w else format(v, form) for v, w in zip(row, whole, strict=True)) + "\n"
        for row in table
    )


def forms() -> tuple[Form, ...]:
    """All of them."""
    return (*named_by_unit(), *without_names(), *to_be_asked(), *clouds_with_a_unit(), *of_old_programs())


def named_by_unit() -> Iterator[Form]:
    """Tables whose header, units' line or preamble says axes and unit."""
    heads = {
        "brackets": "{a} [{u}]",
        "parentheses": "{a}({u})",
        "slash": "{a} / {u}",
        "underscore": "{a}_{u}",
        "position": "Position {a} ({u})",
    }
    places = itertools.cycle([(",", "a.csv"), (";", "a.txt"), ("\t", "a.asc"), (";", "a.csv"), ("\t", "a.dat")])
    for (style, head), unit, points in itertools.product(heads.items(), MM, (PROFILE, CLOUD)):
        axes = "xz" if points.shape[1] == 2 else "xyz"
        separator, name = next(places)
        names = separator.join(head.format(a=axis.upper(), u=unit) for axis in axes)
        body = rows([points / MM[unit]], separator, WRITTEN[unit])
        yield Form(f"{style}, {unit}, {axes}", name, f"{names}\n{body}".encode(), points)
    for unit, points in itertools.product(MM, (PROFILE, CLOUD)):
        axes = "x;z" if points.shape[1] == 2 else "x;y;z"
        body = rows([points / MM[unit]], ";", WRITTEN[unit])
        below = ";".join([unit] * points.shape[1])
        yield Form(f"units below, {unit}", "b.csv", f"{axes}\n{below}\n{body}".encode(), points)
        yield Form(f"preamble, {unit}", "c.txt", f"Unit: {unit}\n{axes}\n{body}".encode(), points)
    for east, north, height in (("Easting", "Northing", "Elevation"), ("East", "North", "Height")):
        head = f"Point ID,{east} [m],{north} [m],{height} [m]\n"
        body = rows([np.arange(len(CLOUD)), CLOUD / 1000], ",", ".7f")
        yield Form(f"surveyor's, {east}", "d.csv", (head + body).encode(), CLOUD)
        named = "".join(
            f"{'AB'[k % 2]}-{k:03d},{line}\n"
            for k, line in enumerate(rows([CLOUD / 1000], ",", ".7f").splitlines())
        )
        yield Form(f"surveyor's labels, {east}", "d.csv", (head + named).encode(), CLOUD)
    for head in ("Index,X,Y,Z,I", "No,X,Y,Z,Q", "t,X,Y,Z,I"):
        columns = [np.arange(len(CLOUD)), CLOUD, np.full(len(CLOUD), 7.0)]
        yield Form(f"header {head}", "e.csv", f"{head}\n{rows(columns, ',')}".encode(), CLOUD)


def without_names() -> Iterator[Form]:
    """Tables without a header of which the numbers themselves leave no doubt."""
    n, m = np.arange(len(PROFILE)), np.arange(len(CLOUD))
    grey, colors = 40 + 3 * (n % 50), np.column_stack([m % 200, m % 90, m % 55])
    share = np.round(0.2 + 0.5 * np.abs(np.sin(m)), 3)
    of_profile = {
        "x z": [PROFILE],
        "x z intensity": [PROFILE, grey],
        "index x z": [n, PROFILE],
        "index from 1 x z": [n + 1, PROFILE],
        "index x z intensity": [n, PROFILE, grey],
        "x 0 z": [PROFILE[:, :1], np.zeros(len(n)), PROFILE[:, 1:]],
    }
    of_cloud = {
        "x y z": [CLOUD],
        "x y z intensity": [CLOUD, 30 + m % 70],
        "x y z share": [CLOUD, share],
        "x y z r g b": [CLOUD, colors],
        "x y z i r g b": [CLOUD, m % 4096 - 2048, colors],
        "x y z normal": [CLOUD, NORMALS],
        "x y z normal r g b": [CLOUD, NORMALS, colors],
        "index x y z": [m, CLOUD],
        "index x y z r g b": [m + 1, CLOUD, colors],
    }
    for separator, end in ((",", "csv"), (";", "csv"), ("\t", "txt"), (" ", "asc")):
        for what, columns in of_profile.items():
            yield Form(f"{what}, {separator!r}", f"f.{end}", rows(columns, separator).encode(), PROFILE)
        for what, columns in of_cloud.items():
            name = f"g.{'xyz' if separator == ' ' else end}"
            yield Form(f"{what}, {separator!r}", name, rows(columns, separator).encode(), CLOUD)


def to_be_asked() -> Iterator[Form]:
    """Tables of which nobody can tell: they are to be doubted, whatever is taken."""
    m, n = np.arange(len(CLOUD)), np.arange(len(PROFILE))
    odd, time_s = 0.37 * m + 900.0, 17.003 + 0.0021 * n
    steps = np.column_stack([n, PROFILE[:, 1]])
    for separator, end in ((",", "csv"), ("\t", "txt")):
        yield Form("time x z", f"h.{end}", rows([time_s, PROFILE], separator).encode(), PROFILE, True)
        yield Form("x z quality", f"h.{end}", rows([PROFILE, time_s], separator).encode(), PROFILE, True)
        yield Form("z x", f"i.{end}", rows([PROFILE[:, ::-1]], separator).encode(), PROFILE, True)
        yield Form("z index", f"i.{end}", rows([PROFILE[:, 1], n], separator).encode(), PROFILE, True)
        yield Form("index z", f"i.{end}", rows([steps], separator).encode(), PROFILE, True)
        yield Form("time x y z", f"k.{end}", rows([odd, CLOUD], separator).encode(), CLOUD, True)
        yield Form("x y z range", f"k.{end}", rows([CLOUD, odd], separator).encode(), CLOUD, True)
        for points in (PROFILE, CLOUD):
            metres = rows([points / 1e6], separator, ".10f")
            yield Form("far too small", f"l.{end}", metres.encode(), points, True)
            large = rows([points * 1000], separator, ".1f")
            yield Form("far too large", f"m.{end}", large.encode(), points, True)


def clouds_with_a_unit() -> Iterator[Form]:
    """Formats of clouds that say their unit, or that must be asked for it."""
    for name, records, metres in (
        ("utm", [(34735, geo_keys({1024: 1, 3072: 32633}))], 1.0),
        ("metres", [(34735, geo_keys({1024: 1, 3072: 25832, 3076: 9001}))], 1.0),
        ("feet", [(34735, geo_keys({1024: 1, 3076: 9002}))], 0.3048),
        ("us feet", [(34735, geo_keys({1024: 1, 3076: 9003}))], 1200 / 3937),
        ("wkt", [(2112, wkt('UNIT["metre",1]'))], 1.0),
        ("wkt feet", [(2112, wkt('UNIT["US survey foot",0.3048006096012192]'))], 0.3048006096012192),
        ("wkt 2", [(2112, b'PROJCRS["x",CS[Cartesian,2],LENGTHUNIT["metre",1,ID["EPSG",9001]]]')], 1.0),
    ):
        yield Form(f"LAS, {name}", "n.las", las(CLOUD / (1000 * metres), records), CLOUD)
    yield Form("LAS without a system", "o.las", las(CLOUD / 1000, []), CLOUD, True)
    yield Form("LAS, millimetres told", "o.las", las(CLOUD, []), CLOUD, settings={"unit": "mm"})
    unknown = [(34735, geo_keys({1024: 1, 3072: 2263}))]
    yield Form("LAS, a system that is not known", "o.las", las(CLOUD / 1000, unknown), CLOUD, True)
    grid = cloud_of(*surface())
    yield Form("PTX", "p.ptx", ptx([grid]), known(grid))
    yield Form("PTX, second of two", "p.ptx", ptx([grid + 1, grid]), known(grid), settings={"scan": 1})
    for upper in (False, True):
        names = "X Y Z INTENSITY" if upper else "x y z intensity"
        head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS {names}\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        head += f"WIDTH {len(CLOUD)}\nHEIGHT 1\nPOINTS {len(CLOUD)}\nDATA ascii\n"
        body = rows([CLOUD, np.arange(len(CLOUD))], " ")
        yield Form(f"PCD, {names}", "q.pcd", (head + body).encode(), CLOUD)
        ply = f"ply\nformat ascii 1.0\nelement vertex {len(CLOUD)}\n"
        ply += "".join(f"property float {axis}\n" for axis in ("XYZ" if upper else "xyz")) + "end_header\n"
        yield Form(f"PLY, {names[:5]}", "r.ply", (ply + rows([CLOUD], " ")).encode(), CLOUD)


def of_old_programs() -> Iterator[Form]:
    """Texts whose bytes are odd and whose numbers are plain."""
    body, half = rows([CLOUD], ","), len(CLOUD) // 2
    yield Form("Ctrl-Z behind", "s.csv", body.encode() + b"\x1a", CLOUD)
    yield Form("zero bytes behind", "s.csv", body.encode() + bytes(512), CLOUD)
    yield Form("printed minus", "s.csv", body.replace("-", "\u2212").encode(), CLOUD)
    yield Form("Japanese", "s.csv", ("X座標(mm),Z高さ(mm)\n" + rows([PROFILE], ",")).encode("cp932"), PROFILE)
    timed = "".join(f"2024-05-01T10:00:{k:02d},{line}\n" for k, line in enumerate(rows([PROFILE], ",").split()))
    yield Form("moments", "s.csv", f"Timestamp,X,Z\n{timed}".encode(), PROFILE)
    scans = "".join(f"{len(part)}\n{rows([part], ' ')}" for part in (CLOUD[:half], CLOUD[half:]))
    yield Form("two scans", "s.pts", scans.encode(), CLOUD)


def geo_keys(values: dict[int, int]) -> bytes:
    """A directory of GeoTIFF keys."""
    words = [1, 1, 0, len(values), *(word for key, value in values.items() for word in (key, 0, 1, value))]
    return np.array(words, "<u2").tobytes()


def wkt(unit: str) -> bytes:
    """A projected system with degrees within and a vertical one behind."""
    inner = 'GEOGCS["WGS 84",UNIT["degree",0.0174532925199433]]'
    return f'COMPD_CS["x",PROJCS["y",{inner},{unit}],VERT_CS["h",UNIT["foot",0.3048]]]'.encode()


def las(points: Floats, records: list[tuple[int, bytes]]) -> bytes:
    """A LAS 1.4 file with records about its coordinate reference system."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 1e-7)
    header.vlrs.extend([VLR("LASF_Projection", number, "", data) for number, data in records])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    stream = io.BytesIO()
    cloud.write(stream)
    return stream.getvalue()


def ptx(grids: list[Floats]) -> bytes:
    """Scans of points (N, 3) in mm with NaN where nothing came back; the second stands 1 m along x."""
    text = ""
    for number, points in enumerate(grids):
        pose = f"1 0 0 0\n0 1 0 0\n0 0 1 0\n{number} 0 0 1\n"
        text += f"{len(points) // 14}\n14\n{number} 0 0\n1 0 0\n0 1 0\n0 0 1\n{pose}"
        text += "".join(
            "0 0 0 0.5\n" if np.isnan(p).any() else " ".join(f"{v:.7f}" for v in p / 1000) + " 0.5\n"
            for p in points
        )
    return text.encode()
