"""The page's files, and the documentation of the API, all from this server: the cell may have no internet."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse

from server.http.page_files import PageFiles

router = APIRouter(include_in_schema=False)


def _page_files(request: Request) -> PageFiles:
    return request.app.state.page_files


PageFilesDep = Annotated[PageFiles, Depends(_page_files)]


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
