"""The page's files, and the documentation of the API, all from this server: the cell may have no internet."""

from typing import Annotated, Literal

from fastapi import APIRouter, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field

from calib_core.findings.catalogues import catalogue
from calib_core.findings.telling import told
from server.http.api_router import of_app
from server.http.page_files import PageFiles

router = APIRouter(include_in_schema=False)


PageFilesDep = Annotated[PageFiles, of_app("page_files")]


class Texts(BaseModel):
    """What a scene shows, in English."""

    texts: list[Annotated[str, Field(max_length=1_000)]] = Field(max_length=500)


@router.get("/")
@router.get("/sessions/{session_id}")
@router.get("/sessions/{session_id}/review")
@router.get("/compare")
@router.get("/access")
@router.get("/equipment")
def page(files: PageFilesDep) -> Response:
    """Return the page; which session it shows stands in its address."""
    return files.document("index.html")


@router.get("/login")
def login_page(files: PageFilesDep) -> Response:
    """Return the page that takes a token and logs the browser in with it."""
    return files.document("login.html")


@router.post("/said/{language}")
def said(language: Literal["de", "zh"], body: Texts) -> dict[str, str]:
    """Return what a scene shows to all in English, in a page's language."""
    words = told({"text": body.texts}, catalogue(language))["text"]
    return dict(zip(body.texts, words, strict=True))


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
