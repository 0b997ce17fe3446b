"""The page's files, and the documentation of the API, all from this server: the cell may have no internet."""

from typing import Annotated, Literal

from fastapi import APIRouter, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field

from server.http.api_router import of_app
from server.http.page_files import PageFiles
from server.http.page_sentences import PageSentences

router = APIRouter(include_in_schema=False)


PageFilesDep = Annotated[PageFiles, of_app("page_files")]
PageSentencesDep = Annotated[PageSentences, of_app("page_sentences")]


class Texts(BaseModel):
    """What a page is about to show, each number in it as 0."""

    texts: list[Annotated[str, Field(max_length=16_000)]] = Field(max_length=2_000)


@router.get("/")
@router.get("/sessions/{session_id}")
@router.get("/sessions/{session_id}/review")
@router.get("/compare")
@router.get("/access")
def page(files: PageFilesDep) -> Response:
    """Return the page; which session it shows stands in its address."""
    return files.document("index.html")


@router.get("/login")
def login_page(files: PageFilesDep) -> Response:
    """Return the page that takes a token and logs the browser in with it."""
    return files.document("login.html")


@router.post("/said/{language}")
def sentences_said(language: Literal["de", "zh"], body: Texts, sentences: PageSentencesDep) -> dict[str, str]:
    """Return the sentences that occur in what the server has answered, in a page's language."""
    return sentences.occurring(language, body.texts)


@router.get("/docs")
def documentation() -> HTMLResponse:
    """Return the interactive documentation of the API."""
    return get_swagger_ui_html(
        openapi_url="/openapi.json",
        title="scancell API",
        swagger_js_url="/web/vendor/swagger-ui/swagger-ui-bundle.js",
        swagger_css_url="/web/vendor/swagger-ui/swagger-ui.css",
        swagger_favicon_url="data:,",
    )
