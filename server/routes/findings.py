"""The table of codes: what each finding means, how it is decided and what to do."""

from typing import Annotated, Literal

from fastapi import Path
from pydantic import BaseModel

from calib_core.findings.pages import page_of
from calib_core.findings.table import CODES, code_named
from server.http.api_router import api_router
from server.http.language import spoken

router = api_router("registries")


class CodeOfFinding(BaseModel):
    """A code; `text` and `to_do` have several entries where a value chooses among them, with places in braces.

    `can_be_changed` where `cell.findings` may give it another severity.
    """

    code: str
    severity: Literal["error", "warning", "note"]
    text: list[str]
    to_do: list[str]
    values: list[str]
    meaning: str
    decided: str
    usual_causes: str
    since: str
    can_be_changed: bool


class CodesOfFindings(BaseModel):
    """The codes by name."""

    items: list[CodeOfFinding]


@router.get("/findings", response_model=CodesOfFindings)
def findings() -> CodesOfFindings:
    """List the codes that findings may have."""
    return CodesOfFindings(
        items=[CodeOfFinding.model_validate(page_of(code, spoken().language)) for code in CODES.values()]
    )


@router.get("/findings/{code}", response_model=CodeOfFinding)
def finding(
    code: Annotated[str, Path(description="A code's name.", max_length=64, examples=["stored-note"])],
) -> CodeOfFinding:
    """Return the page about a code."""
    return CodeOfFinding.model_validate(page_of(code_named(code), spoken().language))
