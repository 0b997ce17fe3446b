"""The page's files, and the documentation of the API, all from this server: the cell may have no internet."""

from fastapi import APIRouter, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import FileResponse, HTMLResponse

from server.http.dependencies import SettingsDep

router = APIRouter(include_in_schema=False)


@router.get("/")
@router.get("/sessions/{session_id}")
@router.get("/sessions/{session_id}/review")
@router.get("/compare")
@router.get("/access")
def page(settings: SettingsDep) -> Response:
    """Return the page; which session it shows stands in its address."""
    return FileResponse(settings.web / "index.html", headers={"Cache-Control": "no-cache"})


@router.get("/login")
def login_page(settings: SettingsDep) -> Response:
    """Return the page that takes a token and logs the browser in with it."""
    return FileResponse(settings.web / "login.html", headers={"Cache-Control": "no-cache"})


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
