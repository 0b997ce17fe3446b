"""HEAD is answered as GET would be, without the body."""

from starlette.types import ASGIApp, Receive, Scope, Send


class HeadRequests:
    """A layer of the application that lets routes see a GET; the server leaves the body out.

    Streams of events have no end that could be waited for.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve."""
        if scope["type"] == "http" and scope["method"] == "HEAD" and not scope["path"].endswith("/events"):
            as_get = {**scope, "method": "GET"}
            await self._app(as_get, receive, send)
            # For the access log.
            scope.update({name: as_get[name] for name in ("route", "state") if name in as_get})
            return
        await self._app(scope, receive, send)
