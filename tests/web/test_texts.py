"""The page's texts: each key stands once, in a file that the catalogue's index takes in, and is used somewhere."""

import re
from collections import Counter
from pathlib import Path

WEB = Path(__file__).resolve().parents[2] / "web"
ENGLISH = WEB / "texts" / "en"
KEY = re.compile(r'^  "([^"]+)": ', re.MULTILINE)


def keys() -> list[str]:
    return [key for file in sorted(ENGLISH.glob("*.js")) for key in KEY.findall(file.read_text(encoding="utf-8"))]


def test_each_key_stands_once_and_its_file_in_the_index() -> None:
    index = (WEB / "texts" / "en.js").read_text(encoding="utf-8")
    for file in ENGLISH.glob("*.js"):
        assert f'import {{ {file.stem} }} from "./en/{file.name}";' in index
        assert f"...{file.stem}" in index
    assert len(keys()) > 500
    assert [key for key, count in Counter(keys()).items() if count > 1] == []


def test_each_key_is_used() -> None:
    """By its name, or by the beginning that code puts a name behind (`status.${word}`)."""
    files = [file for file in WEB.rglob("*.js") if not {"vendor", "texts"} & set(file.parts)]
    code = "\n".join(file.read_text(encoding="utf-8") for file in files)
    begun = re.findall(r"`([a-z_]+[._][a-z_.]*)\$\{", code)
    unused = [key for key in keys() if f'"{key}"' not in code and not any(key.startswith(one) for one in begun)]
    assert unused == []
