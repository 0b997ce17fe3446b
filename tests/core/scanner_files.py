"""Files as scanners' programs write them, made from one truth after their manuals: brand, variant, name, bytes."""

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import cv2
import numpy as np
import tifffile


@dataclass(frozen=True)
class ScannerFile:
    """A file, what it truly holds (NaN where nothing came back), what a user must say about it."""

    brand: str
    variant: str
    name: str
    data: bytes
    truth_mm: np.ndarray
    kind: str
    settings: dict[str, Any] = field(default_factory=dict)
    digits_mm: float = 1e-4


def profile(count: int = 64) -> np.ndarray:
    """An arc over a plane, 200 mm away, with gaps at both ends and one within (count, 2)."""
    x = np.round(np.linspace(-31.5, 31.5, count), 4)
    z = np.where(np.abs(x) < 18, 205 - np.sqrt(np.maximum(20**2 - x**2, 1)), 204 + 0.01 * x)
    points = np.column_stack([x, np.round(z + 0.013 * np.sin(9 * x), 4)])
    points[[0, 1, 20, 21, 40, -1], 1] = np.nan
    return points


def surface(rows: int = 9, columns: int = 14) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x (W), y (H) and z (H, W) of a grid, with gaps."""
    x, y = np.round(-6.5 + np.arange(columns) * 1.0, 4), np.round(np.arange(rows) * 0.5, 4)
    z = np.round(12 + 0.3 * np.sin(x)[None, :] + 0.2 * np.cos(2 * y)[:, None], 4)
    z[0, :2] = z[3, 5] = z[-1, -1] = np.nan
    return x, y, z


def cloud_of(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The points (H W, 3) of a grid."""
    points = np.stack([np.broadcast_to(x, z.shape), np.broadcast_to(y[:, None], z.shape), z], axis=-1).reshape(
        -1, 3
    )
    return np.where(np.isnan(points[:, 2:]), np.nan, points)


def known(points: np.ndarray) -> np.ndarray:
    """The rows without NaN."""
    return points[np.isfinite(points).all(axis=1)]


def _text(
    head: str,
    rows: Iterator[tuple[float, ...]] | np.ndarray,
    separator: str,
    missing: str,
    end: str = "\n",
    form: str = ".4f",
) -> str:
    lines = [separator.join(missing if np.isnan(v) else format(v, form) for v in row) for row in rows]
    return head.replace("\n", end) + end.join(lines) + end


@cache
def scanner_files() -> tuple[ScannerFile, ...]:
    """Every brand in its variants."""
    makers = (_keyence, _micro_epsilon, _lmi, _cognex, _sick, _wenglor)
    return tuple(file for maker in makers for file in maker())


def _profile_file(brand: str, variant: str, text: str | bytes, name: str = "p.csv", **more: Any) -> ScannerFile:
    data = text.encode() if isinstance(text, str) else text
    return ScannerFile(brand, variant, name, data, profile(), "profile", **more)


def _keyence() -> Iterator[ScannerFile]:
    p = profile()
    counts = np.where(np.isnan(p), -2147483648, np.round(np.nan_to_num(p) * 1e5)).astype(np.int64)
    tsv = "".join(f"{x}\t{z}\r\n" for x, z in counts)
    yield _profile_file("keyence", "library, counts of 0.01 µm", tsv, "p.txt")
    two = "".join(f"{x}\t{z - 100}\t{z}\r\n" if z > -1e9 else f"{x}\t{z}\t{z}\r\n" for x, z in counts)
    yield _profile_file("keyence", "two profiles, one chosen", two, "p.tsv", settings={"profile": 2})
    yield _profile_file("keyence", "sample program, mm, -999.9999", _text("", p, "\t", "-999.9999"), "p.txt")
    head = "Model,LJ-X8080\nUnit,mm\n\nX(mm),Z(mm)\n"
    yield _profile_file("keyence", "preamble, -99999.99", _text(head, p, ",", "-99999.99", "\r\n"))
    x, y, z = surface()
    settings = {"x_pitch_mm": 1.0, "y_pitch_mm": 0.5, "x_start_mm": -6.5}
    image = np.where(np.isnan(z), 0, np.round(np.nan_to_num(z) / 0.001) + 32768).astype(np.uint16)
    told = {**settings, "z_scale_mm": 0.001, "z_zero": 32768}
    stream = io.BytesIO()
    tifffile.imwrite(stream, image)
    yield ScannerFile(
        "keyence",
        "height image TIFF, 32768 = 0",
        "h.tif",
        stream.getvalue(),
        cloud_of(x, y, z),
        "cloud",
        told,
        6e-4,
    )
    plain = _text("", z, ",", "-999.9999").encode()
    yield ScannerFile("keyence", "heights CSV, pitches told", "h.csv", plain, cloud_of(x, y, z), "cloud", settings)


def _micro_epsilon() -> Iterator[ScannerFile]:
    p = profile()
    yield _profile_file("micro-epsilon", "two columns, tab", _text("X [mm]\tZ [mm]\n", p, "\t", "0.0000"), "p.txt")
    german = _text("X [mm];Z [mm];Intensität\n", np.column_stack([p, np.full(len(p), 7)]), ";", "0.0000")
    yield _profile_file(
        "micro-epsilon", "German, decimal comma, cp1252", german.replace(".", ",").encode("cp1252")
    )
    zeros = np.where(np.isnan(p).any(axis=1, keepdims=True), 0, p)
    yield _profile_file("micro-epsilon", "0,0 where nothing came back", _text("", zeros, ",", ""), "p.csv")
    utf16 = _text("X-Achse (mm)\tZ-Achse (mm)\n", p, "\t", "NaN", "\r\n").encode("utf-16")
    yield _profile_file("micro-epsilon", "UTF-16 spreadsheet", utf16, "p.txt")
    x, y, z = surface()
    asc = _text("", cloud_of(x, y, z), " ", "-1.#IND", "\r\n").encode()
    yield ScannerFile("micro-epsilon", "ASC cloud, -1.#IND", "c.asc", asc, cloud_of(x, y, z), "cloud")


def _lmi() -> Iterator[ScannerFile]:
    p = profile()
    info = (
        "Info\nCSV Version,Sensor Count,Trigger Mode\n2,1,0\nEnd\nDeviceInfo\nID,Model\n13434,311320-2M-01\nEnd\n"
    )
    fixed = "Frame,Source,Time,Encoder,Z Encoder,Inputs,Exposure,Y,Axis"
    cell = ["" if np.isnan(v) else f"{v:.4f}" for v in p[:, 1]]
    uniform = (
        f"{info}Profile\nFrame Count,Column Count,X Offset,X Resolution\n1,{len(p)},0,0.1\n"
        + f"{fixed},{','.join(f'{x:.4f}' for x in p[:, 0])}\n0,0,12,0,0,0,100,0,Z,{','.join(cell)}\n"
        + f"0,0,12,0,0,0,100,0,I,{','.join('9' for _ in cell)}\nEnd\n"
    )
    yield _profile_file("lmi", "Profile section", uniform)
    raw = (
        f"{info}RawProfile\nFrame Count,Column Count,X Offset\n2,{len(p)},0\n{fixed},"
        + ",".join(map(str, range(len(p)))) + "\n"
        + "".join(
            f"{frame},0,12,0,0,0,100,0,X,{','.join('' if np.isnan(z) else f'{x + frame:.4f}' for x, z in p)}\n"
            f"{frame},0,12,0,0,0,100,0,Z,{','.join(cell)}\n"
            for frame in range(2)
        )
        + "End\n"
    )  # fmt: skip
    yield _profile_file("lmi", "RawProfile, a frame chosen", raw.replace("\n", "\r\n"), settings={"frame": 0})
    x, y, z = surface()
    rows = "".join(
        f"{a:.4f},{','.join('' if np.isnan(v) else f'{v:.4f}' for v in r)}\n" for a, r in zip(y, z, strict=True)
    )
    grid = f"Y\\X,{','.join(f'{v:.4f}' for v in x)}\n{rows}"
    part = f"{info}Part\nFrame,Source,X Offset\n0,0,0\n{grid}End\n"
    truth = cloud_of(x, y, z)
    yield ScannerFile("lmi", "Part section, y/x grid", "s.csv", part.encode(), truth, "cloud")
    yield ScannerFile("lmi", "y/x grid alone", "s.csv", ("," + grid.split(",", 1)[1]).encode(), truth, "cloud")
    flat = "\n".join(",".join("" if np.isnan(v) else f"{v:.4f}" for v in row) for row in truth.reshape(len(y), -1))
    header = f"{info}SurfacePointCloud\nFrame,Source,X Offset\n0,0,0\n{','.join(map(str, range(3 * len(x))))}"
    points = f"{header}\n{flat}\nEnd\n"
    yield ScannerFile("lmi", "SurfacePointCloud section", "s.csv", points.encode(), truth, "cloud")
    image = np.where(np.isnan(z), 0, np.round(np.nan_to_num(z) / 0.001) + 32768).astype(np.uint16)
    image = np.vstack([image, image, np.full((1, len(x)), 777, np.uint16)])
    told = {
        "x_pitch_mm": 1.0,
        "y_pitch_mm": 0.5,
        "x_start_mm": -6.5,
        "z_scale_mm": 0.001,
        "z_zero": 32768,
        "rows": len(y),
    }
    png = cv2.imencode(".png", image)[1].tobytes()
    yield ScannerFile("lmi", "16-bit grey with stamps", "s.png", png, truth, "cloud", told, 6e-4)


def _cognex() -> Iterator[ScannerFile]:
    x, y, z = surface()
    truth = cloud_of(x, y, z)
    counts = np.where(np.isnan(z), 0, np.round(np.nan_to_num(z) / 0.01 * 20)).astype(np.uint16)
    told = {"x_pitch_mm": 1.0, "y_pitch_mm": 0.5, "x_start_mm": -6.5, "z_scale_mm": 0.0005}
    png = cv2.imencode(".png", counts)[1].tobytes()
    yield ScannerFile("cognex", "16-bit range image, 0 missing", "r.png", png, truth, "cloud", told, 3e-4)
    table = _text("X,Y,Z\n", truth, ",", "").encode("utf-8-sig")
    yield ScannerFile("cognex", "points CSV, blanks, BOM", "r.csv", table, truth, "cloud")
    numbered = "Index,X,Y,Z\n" + "".join(
        f"{k},{','.join('' if np.isnan(v) else f'{v:.4f}' for v in row)}\n" for k, row in enumerate(truth)
    )
    yield ScannerFile("cognex", "index before x, y, z", "r.csv", numbered.encode(), truth, "cloud")
    yield _profile_file("cognex", "profile, quoted fields", _quoted(profile()))
    metres = _text("X (m),Z (m)\n", profile() / 1000, ",", "", form=".7f")
    yield _profile_file("cognex", "profile in metres, stated", metres)


def _quoted(points: np.ndarray) -> str:
    rows = "".join(f'"{x:.4f}","{"" if np.isnan(z) else f"{z:.4f}"}"\n' for x, z in points)
    return '"X [mm]","Z [mm]"\n' + rows.replace(".", ".")


def _sick() -> Iterator[ScannerFile]:
    x, y, z = surface()
    truth = cloud_of(x, y, z)
    counts = np.where(np.isnan(z), 0, np.round((np.nan_to_num(z) - 5) / 0.0002)).astype(np.uint16)
    told = {"x_pitch_mm": 1.0, "y_pitch_mm": 0.5, "x_start_mm": -6.5, "z_scale_mm": 0.0002, "z_offset_mm": 5.0}
    png = cv2.imencode(".png", counts)[1].tobytes()
    yield ScannerFile(
        "sick", "range PNG, Coord3D_C16 scale and offset", "r.png", png, truth, "cloud", told, 1.1e-4
    )
    stream = io.BytesIO()
    tifffile.imwrite(stream, z.astype(np.float32))
    floats = {key: told[key] for key in ("x_pitch_mm", "y_pitch_mm", "x_start_mm")}
    yield ScannerFile("sick", "float TIFF, NaN missing", "r.tif", stream.getvalue(), truth, "cloud", floats)
    rows = np.where(np.isnan(truth), 0, truth).astype("<f4")
    pcd = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    pcd += f"WIDTH {len(x)}\nHEIGHT {len(y)}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA binary\n"
    yield ScannerFile(
        "sick", "organised PCD, zeros missing", "c.pcd", pcd.encode() + rows.tobytes(), truth, "cloud"
    )
    yield _profile_file("sick", "profile in µm", _text("X [µm];Z [µm]\n", profile() * 1000, ";", "", form=".1f"))
    head = "Device: Ruler3020\nUnit: mm\nMissing data: 65535\n\nx z\n"
    yield _profile_file("sick", "65535 where nothing came back", _text(head, profile(), " ", "65535"), "p.txt")


def _wenglor() -> Iterator[ScannerFile]:
    p = profile()
    whole = np.column_stack([np.arange(len(p)), p, np.full(len(p), 120), np.full(len(p), 3)])
    yield _profile_file("wenglor", "number; x; z; intensity; width", _text("No;X;Z;I;W\n", whole, ";", "0"))
    swapped = np.column_stack([p[:, 1], p[:, 0]])
    yield _profile_file("wenglor", "z before x", _text("Z [mm],X [mm]\n", swapped, ",", "NaN"))
    flat = np.insert(known(p), 1, 0.0, axis=1)
    ply = "ply\nformat ascii 1.0\ncomment unit mm\n" + f"element vertex {len(flat)}\n"
    ply += "property float x\nproperty float y\nproperty float z\nend_header\n" + _text("", flat, " ", "")
    yield ScannerFile("wenglor", "PLY of one profile, y = 0", "p.ply", ply.encode(), known(p), "profile")
    german = "Sensor;MLSL123\r\nDatum;21.11.2026\r\n\r\nX;Z\r\nmm;mm\r\n"
    german += _text("", p, ";", "", "\r\n").replace(".", ",")
    yield _profile_file("wenglor", "German spreadsheet with units below", german)
    inches = _text("X [inch]\tZ [inch]\n", p / 25.4, "\t", "-999", form=".7f")
    yield _profile_file("wenglor", "inches, -999", inches, "p.txt")
    x, y, z = surface()
    xyz = known(cloud_of(x, y, z))
    counted = f"{len(xyz)}\n" + _text("", xyz, " ", "")
    yield ScannerFile("wenglor", "PTS with its count", "c.pts", counted.encode(), xyz, "cloud")


def las(points: np.ndarray) -> bytes:
    """The smallest LAS 1.2 file of points (N, 3), by the specification's own layout."""
    scale, count = 0.0001, len(points)
    head = struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I", b"LASF", 0, 0, 0, 0, 0, b"", 1, 2, b"", b"", 1, 2026,
        227, 227, 0, 0, 20, count, *[count, 0, 0, 0, 0],
    )  # fmt: skip
    low, high = points.min(axis=0), points.max(axis=0)
    head += struct.pack("<12d", *[scale] * 3, 0, 0, 0, *[v for pair in zip(high, low, strict=True) for v in pair])
    rows = np.zeros(count, dtype=[("xyz", "<i4", 3), ("rest", "u1", 8)])
    rows["xyz"] = np.round(points / scale)
    return head + rows.tobytes()
