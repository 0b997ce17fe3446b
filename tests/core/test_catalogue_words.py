"""The words of the German and Chinese catalogues: one term a thing, as the field says it."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from babel.messages.pofile import read_po

ROOT = Path(__file__).resolve().parents[2]
NEVER = {
    "de": {
        r"Handgerät": "Bediengerät",
        r"Benutzersystem": "Benutzerkoordinatensystem",
        r"\bSicherung\b|\bSicherungen\b": "Backup",
        r"[Ll]aserstreifen|[Dd]e[rnms] Streifens?\b|[Ee]inen? Streifen\b|Lichtlinie": "Laserlinie",
        r"Lichtebene": "Laserebene",
        r"Kalibrierzertifikat|Zertifikate?s? der Kugel": "Kalibrierschein",
        r"Abfahrt|\bSweeps?\b": "Scanfahrt",
        r"\bRahmen\b|Laserrahmen|Lasersystem|Kamerasystem": "Koordinatensystem",
        r"malgenommen": "multipliziert",
        r"[Bb]erichtig": "korrigieren",
        r"\b[Bb]enutz(t|te|ten|en)\b": "verwenden",
        r"\b(ge|mit(zu)?)?lös(en|t|te)\b|gelöst": "berechnen",
        r"[Rr]esiduals?\b|Restfehler": "Residuen",
        r"Antworten? (ist|liegen|sind) ": "Ergebnis",
    },
    "zh": {
        r"(?<!激)光条": "激光条纹",
        r"阶段": "步骤",
        r"存档": "归档",
        r"球体|标准球": "球",
        r"球棒": "球杆",
        r"装夹": "安装",
        r"格距": "间距",
        r"重放": "重算",
        r"复查": "复检",
        r"检查移动|检查运动": "验证运动",
        r"工作站": "单元",
        r"名义": "标称",
        r"(\} ?|[0-9一两三每] ?)个采集|个扫描(?!仪|单元|文件)": "次",
        r"条轮廓": "个轮廓",
        r"[\u4e00-\u9fff] …|[\u4e00-\u9fff]…$": "……",
        r"[\u4e00-\u9fff][;?!]": "Chinese punctuation",
    },
}
ALWAYS = {
    "de": {r"check move": "Prüffahrt", r"stated uncertainty": "angegeben"},
    "zh": {
        r"check move": "验证运动",
        r"stated uncertainty": "标称不确定度",
        r"^[Rr]eview\b": "复核",
        r"\bnominal\b(?!\.)": "标称",
    },
}


def _entries(language: str) -> Iterator[tuple[str, str]]:
    files = sorted((ROOT / "calib_core/findings/locale" / language).glob("*.po"))
    for file in [ROOT / f"web/texts/{language}.po", *files]:
        with file.open("rb") as stream:
            for one in read_po(stream, locale=language):
                said = one.string if isinstance(one.string, str) else " ".join(one.string or ())
                if one.id:
                    yield " ".join([one.id] if isinstance(one.id, str) else one.id), said


@pytest.mark.parametrize("language", NEVER)
def test_terms_that_must_not_appear(language: str) -> None:
    entries = list(_entries(language))
    found = [
        f"{text!r} ({english!r}): say {better}"
        for pattern, better in NEVER[language].items()
        for english, text in entries
        if re.search(pattern, text)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("language", ALWAYS)
def test_terms_that_have_one_translation(language: str) -> None:
    entries = list(_entries(language))
    found = [
        f"{text!r} ({english!r}): lacks {term}"
        for pattern, term in ALWAYS[language].items()
        for english, text in entries
        if re.search(pattern, english) and term not in text
    ]
    assert not found, "\n".join(found)
