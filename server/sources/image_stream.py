"""A camera or scanner that sends exposures over HTTP, one part after the other (multipart/x-mixed-replace)."""

import http.client
import re
from urllib.parse import urlsplit

from pydantic import Field, SecretStr

from calib_core.errors import InputError
from calib_core.messages import message
from server.sources.device import Description, Frame, host_now_s
from server.sources.source import Settings, Source

_ENDINGS = {
    "image/png": ".png",
    "image/jpeg": ".jpg",
    "image/bmp": ".bmp",
    "image/tiff": ".tif",
    "text/csv": ".csv",
}
_MOST_BYTES = 64 * 1024 * 1024


class ImageStreamSettings(Settings):
    """The stream's address, and a token where it asks for one."""

    url: str = Field(pattern=r"^https?://\S+$", max_length=1000)
    token: SecretStr | None = None


class ImageStream:
    """Reads part after part; `X-Timestamp`, in seconds, is the exposure's device time."""

    def __init__(self, settings: ImageStreamSettings) -> None:
        address = urlsplit(settings.url)
        make = http.client.HTTPSConnection if address.scheme == "https" else http.client.HTTPConnection
        self._connection = make(address.hostname or "", address.port, timeout=1.5)
        token = settings.token.get_secret_value() if settings.token else ""
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._number = 0
        try:
            self._connection.request("GET", f"{address.path or '/'}?{address.query}".rstrip("?"), headers=headers)
            self._answer = self._connection.getresponse()
            kind = self._answer.headers.get("Content-Type", "")
            if self._answer.status != 200 or not kind.startswith("multipart/"):
                got = f"{self._answer.status} {kind}"
                raise InputError("a stream of multipart/x-mixed-replace", got, "Check the address.", settings.url)
        except BaseException:
            self._connection.close()
            raise

    def describe(self) -> Description:
        """Return that it sends exposures."""
        return Description("HTTP stream", can=("images", "profiles", "device time"))

    def read(self) -> Frame | None:
        """Return the next part; raises OSError where none comes within a second and a half."""
        head = self._head()
        ending = _ENDINGS.get(head.get("content-type", "").partition(";")[0].strip())
        size = head.get("content-length", "")
        if ending is None or not re.fullmatch(r"\d{1,9}", size) or int(size) > _MOST_BYTES:
            raise ConnectionError(f"a part that is no exposure with its length: {head}"[:200])
        content = self._answer.read(int(size))
        if len(content) < int(size):
            raise ConnectionError(message("the stream ended within an exposure"))
        self._number += 1
        moment = head.get("x-timestamp")
        return Frame(host_now_s(), f"{self._number:08d}{ending}", content, float(moment) if moment else None)

    def _head(self) -> dict[str, str]:
        head: dict[str, str] = {}
        while True:
            line = self._answer.readline(2000)
            if not line:
                raise ConnectionError(message("the stream ended"))
            text = line.decode("latin-1").strip()
            if not text and head:
                return head
            name, colon, value = text.partition(":")
            if colon and not text.startswith("--"):
                head[name.strip().lower()] = value.strip()

    def close(self) -> None:
        """Close the connection."""
        self._answer.close()
        self._connection.close()


SOURCE = Source(
    "image-stream",
    "Camera or scanner: HTTP stream",
    "Reads images or profiles that are sent one after the other over HTTP.",
    ImageStreamSettings,
    connect=ImageStream,
    delivers=("scanner",),
    clock="every-reading",
)
