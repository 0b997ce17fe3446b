"""Controllers' files built from known positions, changed in known ways; the judge shares nothing with the readers.

A file is a list of entries; a mutation changes entries or bytes and keeps account of what each name may become.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass

from calib_core.errors import InputError
from calib_core.robots.backup import read_controller_files
from calib_core.robots.controller_file import ControllerFile
from calib_core.robots.file_hints import NOTHING_TOLD, Told

Numbers = tuple[str, ...]


@dataclass
class Entry:
    """One position: its name as the reader gives it, its numbers, its text, and whether that is well formed.

    `may_be`: it may be read all the same; `told`: it may be left out, aloud.
    """

    name: str
    numbers: Numbers
    text: str
    sound: bool = True
    may_be: bool = True
    told: bool = False


@dataclass
class File:
    """A file before and after its entries, and how it is encoded."""

    head: str
    entries: list[Entry]
    tail: str
    ends: str = "\n"
    encoding: str = "utf-8"
    cut_at: float | None = None
    head_sound: bool = True  # of a table: what its header says of units can be obeyed
    factor: float = 1.0  # from its unit to the reader's

    def data(self) -> tuple[bytes, int]:
        """Return the bytes, and how many of the text's characters are kept."""
        text = self.head + "".join(e.text for e in self.entries) + self.tail
        kept = len(text) if self.cut_at is None else int(len(text) * self.cut_at)
        return text[:kept].replace("\n", self.ends).encode(self.encoding), kept


def _kuka(name: str, n: Numbers) -> str:
    fields = ",".join(f"{a} {v}" for a, v in zip("XYZABC", n, strict=True))
    motion = '{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}'
    return f"DECL E6POS {name}={{{fields},S 2,T 3,E1 0.0}}\nDECL FDAT F{name[1:]}={motion}\n"


def _abb(name: str, n: Numbers) -> str:
    place = ",".join(n[:3])
    return f"  CONST robtarget {name}:=[[{place}],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"


def _fanuc(name: str, n: Numbers) -> str:
    x, y, z, w, p, r = n
    return (
        f"{name}{{\n   GP1:\n\tUF : 0, UT : 0,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
        f"\tX = {x}  mm,\tY = {y}  mm,\tZ = {z}  mm,\n"
        f"\tW = {w} deg,\tP = {p} deg,\tR = {r} deg\n}};\n"
    )


def _ur(name: str, n: Numbers) -> str:
    return f"  {name}=p[{', '.join(n)}]\n"


def _yaskawa(name: str, n: Numbers) -> str:
    return f"{name}={','.join(n)}\n"


def _kawasaki(name: str, n: Numbers) -> str:
    return f"{name} {' '.join(n)}\n"


def _staubli(name: str, n: Numbers) -> str:
    pairs = " ".join(f'{a}="{v}"' for a, v in zip(("x", "y", "z", "rx", "ry", "rz"), n, strict=True))
    plain = name.removesuffix("[0]")
    return (
        f'<Data name="{plain}" access="private" xsi:type="array" type="pointRx" size="1">\n'
        f'<Value key="0" {pairs} fatherId="world[0]" />\n</Data>\n'
    )


def _nachi(name: str, n: Numbers) -> str:
    return f"MOVEX A=1P,AC=0,SM=0,M1X,L,({', '.join(n)}),S=100.0,H=0,MS,CONF=0000\n"


def _ros(name: str, n: Numbers) -> str:
    place = "".join(f"    {axis}: {v}\n" for axis, v in zip("xyz", n, strict=False))
    head = "header:\n  stamp:\n    sec: 1\n    nanosec: 0\n  frame_id: base_link\n"
    turn = "  orientation:\n    x: 0.0\n    y: 0.0\n    z: 0.0\n    w: 1.0\n"
    return f"{head}pose:\n  position:\n{place}{turn}---\n"


def _table(name: str, n: Numbers) -> str:
    return f"{name},{','.join(n)}\n"


def _statement(before: str, after: str) -> Callable[[str, Numbers], str]:
    """Return how a line-by-line dialect writes a position."""
    return lambda name, n: f"{name}{before}{', '.join(n)}{after}\n"


_NS = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xmlns="http://www.staubli.com/robotics/VAL3/Data/2"'
BRANDS: dict[str, tuple[str, str, str, Callable[[str, Numbers], str], Callable[[int], str], float]] = {
    "kuka": ("a.dat", "DEFDAT a\n", "ENDDAT\n", _kuka, lambda i: f"XP{i}", 1.0),
    "abb": ("a.mod", "MODULE a\n", "ENDMODULE\n", _abb, lambda i: f"p{i}", 1.0),
    "fanuc": ("a.ls", "/PROG  A\n/MN\n/POS\n", "/END\n", _fanuc, lambda i: f"P[{i}]", 1.0),
    "ur": ("a.script", "def a():\n", "end\n", _ur, lambda i: f"q{i}_p", 1e-3),
    "yaskawa": ("A.JBI", "/JOB\n//NAME A\n//POS\n///TOOL 0\n///POSTYPE BASE\n///RECTAN\n", "//INST\nNOP\n",
                _yaskawa, lambda i: f"C{i:05d}", 1.0),
    "kawasaki": ("a.as", ".TRANS\n", ".END\n", _kawasaki, lambda i: f"p{i}", 1.0),
    "staubli": ("a.dtx", f"<Database {_NS}>\n<Datas>\n", "</Datas>\n</Database>\n", _staubli,
                lambda i: f"p{i}[0]", 1.0),
    "mitsubishi": ("a.prg", "' a\n", "' b\n", _statement("=(", ")(7,0)"), lambda i: f"P{i}", 1.0),
    "denso": ("a.pcs", "TakeArm\n", "GiveArm\n", _statement(" = P(", ")"), lambda i: f"P[{i}]", 1.0),
    "epson": ("a.prg", "Function main\n", "Fend\n", _statement(" = XY(", ") /R"), lambda i: f"P{i}", 1.0),
    "comau": ("a.pdl", "PROGRAM a NOHOLD\nBEGIN\n", "END a\n", _statement(" := POS(", ", '')"), lambda i: f"p{i}",
              1.0),
    "nachi": ("a.src", "REM a\n", "END\n", _nachi, lambda i: f"line {i}", 1.0),
    "ros": ("a.yaml", "# a\n", "# b\n", _ros, lambda i: f"line {i}", 1e-3),
    "table": ("a.csv", "name,x_mm,y_mm,z_mm,A_deg,B_deg,C_deg\n", "# end\n", _table, lambda i: f"p{i}", 1.0),
    "doosan": ("a.drl", "# a\n", "# b\n", _statement(" = posx(", ")"), lambda i: f"p{i}", 1.0),
}  # fmt: skip
_UNNAMED = ("nachi", "ros")  # a pose is known by its line: by its numbers here
_PLACES_ALONE = ("abb", "ros")  # whose rotation is the same everywhere here
_TOLD = {"table": Told(convention="kuka")}
_GARBAGE = ("", "nan", "1e999", "--5", "0x1F", "1.2.3", "abc", "5mm", "1_000", "٣", "inf", "+", "1e", "$5")


def _number(chance: random.Random, size: float) -> str:
    return chance.choice((f"{chance.uniform(-size, size):.6f}", f"{chance.uniform(-size, size):.4e}"))


def built(brand: str, chance: random.Random) -> File:
    """Return a whole file with a few positions."""
    _, head, tail, write, named, scale = BRANDS[brand]
    entries: list[Entry] = []
    for i in range(chance.randint(1, 6)):
        turn = 1.5 if brand == "ur" else 179.0
        sizes = [1500 * scale] * 3 + [turn] * 3
        n = tuple(_number(chance, s) for s in sizes)
        entries.append(Entry(named(i), n, write(named(i), n)))
    return File(head, entries, tail)


def mutated(brand: str, chance: random.Random) -> File:
    """Return a file with one or two structural mutations."""
    file = built(brand, chance)
    for _ in range(chance.randint(1, 2)):
        chance.choice(_WAYS)(file, brand, chance)
    return file


def _cut(file: File, brand: str, chance: random.Random) -> None:
    file.cut_at = chance.uniform(0.0, 1.0)


def _double(file: File, brand: str, chance: random.Random) -> None:
    file.entries.insert(chance.randint(0, len(file.entries)), chance.choice(file.entries))


def _contradict(file: File, brand: str, chance: random.Random) -> None:
    """Give a name a second time, with other numbers: where both can be read, neither may be taken."""
    entry = chance.choice(file.entries)
    other = (*entry.numbers[:2], _number(chance, 1.0), *entry.numbers[3:])
    file.entries.append(Entry(entry.name, other, BRANDS[brand][3](entry.name, other)))


def _reorder(file: File, brand: str, chance: random.Random) -> None:
    chance.shuffle(file.entries)


def _drop(file: File, brand: str, chance: random.Random) -> None:
    if len(file.entries) > 1:
        file.entries.pop(chance.randrange(len(file.entries)))


def _spoil_number(file: File, brand: str, chance: random.Random) -> None:
    i = chance.randrange(len(file.entries))
    entry = file.entries[i]
    k = chance.randrange(3 if brand in _PLACES_ALONE else 6)
    numbers = (*entry.numbers[:k], chance.choice(_GARBAGE), *entry.numbers[k + 1 :])
    text = BRANDS[brand][3](entry.name, numbers)
    file.entries[i] = Entry(entry.name, entry.numbers, text, sound=False, may_be=False)


def _spoil_bracket(file: File, brand: str, chance: random.Random) -> None:
    i = chance.randrange(len(file.entries))
    entry = file.entries[i]
    places = [p for p, c in enumerate(entry.text) if c in '[]{}()<>"' and c not in entry.name]
    if not places or brand in ("kawasaki", "yaskawa"):
        return
    p = chance.choice(places)
    text = entry.text[:p] + entry.text[p + 1 :]
    for one in file.entries:  # what follows an open bracket may be lost with it, aloud
        one.told = True
    file.entries[i] = Entry(entry.name, entry.numbers, text, sound=False)


def _other_ends(file: File, brand: str, chance: random.Random) -> None:
    file.ends = chance.choice(("\r\n", "\r", "\n"))


def _other_encoding(file: File, brand: str, chance: random.Random) -> None:
    file.encoding = chance.choice(("utf-8-sig", "latin-1", "utf-16"))


def _units(file: File, brand: str, chance: random.Random) -> None:
    if brand == "table":  # the header says another unit: positions come in millimetres, angles not at all
        old, new = chance.choice((("_mm", "_m"), ("_mm", ""), ("x_mm", "x_m"), ("_deg", "_rad"), ("y_mm", "y_cm")))
        file.head = file.head.replace(old, new)
        units = {word[1:] for word in file.head.strip().split(",")[1:4]}
        file.factor = 1000.0 if "_m" in units else 1.0
        file.head_sound = len(units) == 1 and units != {"_cm"} and "_rad" not in file.head
        return
    i = chance.randrange(len(file.entries))
    entry = file.entries[i]
    if brand == "fanuc":
        text = entry.text.replace("mm", chance.choice(("in", "cm", "m", "")), 1)
    elif brand == "ur":
        text = BRANDS[brand][3](entry.name, ("1234.5", *entry.numbers[1:]))
    else:
        return
    file.entries[i] = Entry(entry.name, entry.numbers, text, sound=False, may_be=False)


_WAYS = (
    _cut, _double, _contradict, _reorder, _drop, _spoil_number, _spoil_bracket, _other_ends, _other_encoding,
    _units,
)  # fmt: skip


def judged(brand: str, file: File) -> str | None:
    """Return what is wrong with how a file is read, None where all is right or told."""
    try:
        data, kept = file.data()
    except UnicodeEncodeError:
        return None  # there is no such file
    try:
        read = read_controller_files({BRANDS[brand][0]: data}, brand, told=_TOLD.get(brand, NOTHING_TOLD))
    except InputError as error:
        unharmed = file.cut_at is None and file.head_sound and all(e.sound for e in file.entries)
        return f"refused whole: {error}" if unharmed else None
    surely: dict[str, set[tuple[float, ...]]] = {}
    perhaps: dict[str, set[tuple[float, ...]]] = {}
    position = len(file.head)
    count = 3 if brand in _PLACES_ALONE else 6
    for entry in file.entries:
        position += len(entry.text)
        whole = entry.sound and file.head_sound and not entry.told and position <= kept
        if whole or (entry.may_be and file.head_sound and position - len(entry.text) < kept):
            taken = tuple(float(v) * (file.factor if k < 3 else 1.0) for k, v in enumerate(entry.numbers[:count]))
            name = str(taken) if brand in _UNNAMED else entry.name.lower()
            (surely if whole else perhaps).setdefault(name, set()).add(taken)
    whole_ones = [pose for pose in read.poses if "make sure that it is whole" not in pose.doubt]
    told = {pose.name.lower() for pose in read.poses} - {
        pose.name.lower() for pose in whole_ones
    }  # cut, and so told
    numbers = [(pose.name.lower(), (pose.as_written or ())[:count]) for pose in whole_ones]
    poses = [(str(taken) if brand in _UNNAMED else name, taken) for name, taken in numbers]
    return _wrong(read, poses, told, surely, perhaps)


def _wrong(
    read: ControllerFile,
    poses: list[tuple[str, tuple[float, ...]]],
    told: set[str],
    surely: dict[str, set[tuple[float, ...]]],
    perhaps: dict[str, set[tuple[float, ...]]],
) -> str | None:
    for name, taken in poses:
        whole = surely.get(name, set())
        wanted = set() if len(whole) > 1 else whole | perhaps.get(name, set())
        if not any(_same(taken, one) for one in wanted):
            return f"silently wrong: {name} {taken}, expected {sorted(wanted)}"
    names = {name for name, _ in poses} | told
    reasons = " ".join(row.reason.lower() for row in read.skipped if row.line > 0)
    for name, whole in surely.items():
        lost = name not in names and (len(whole) > 1 or name not in perhaps)
        if lost and name not in reasons and not (len(whole) == 1 and reasons):
            return f"lost without a word: {name}"
    return None


def _same(taken: tuple[float, ...], expected: tuple[float, ...]) -> bool:
    return taken == expected or (
        len(taken) == len(expected)
        and all(abs(a - b) <= 1e-12 * abs(b) for a, b in zip(taken, expected, strict=True))
    )
