"""ABB: Robot Web Services, 1.0 of IRC5 and 2.0 of OmniCore, read alone."""

import math
import re
from typing import Any
from xml.etree import ElementTree

from pydantic import Field, SecretStr

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.pose_settings import Interval, Pace, axis_number
from server.sources.source import Settings, Source

_ACCEPT = "application/xhtml+xml;v=2.0, application/xhtml+xml;q=0.8"
_NO_AXIS = 8.9e9  # the controller writes 9E9 where there is no external axis


class AbbRwsSettings(Settings):
    """The controller's web server: `http://…` of IRC5, `https://…` of OmniCore, whose certificate is its own.

    `table_unit` is the mechanical unit that turns the table where it is not an external axis of the robot's own.
    """

    url: str = Field(pattern=r"^https?://\S+$", max_length=500, examples=["http://192.168.125.1"])
    user: str = Field(default="Default User", max_length=100)
    password: SecretStr = SecretStr("robotics")
    verify: bool = Field(default=True, description="Check the certificate; false for the controller's own.")
    unit: str = Field(default="ROB_1", pattern=r"^\w{1,32}$")
    table_axis: str | None = Field(default=None, pattern=r"^E[1-6]$")
    table_unit: str | None = Field(default=None, pattern=r"^\w{1,32}$")
    interval_s: Interval = 0.05


class AbbRws:
    """Asks for joints, then for the flange in the base: tool0, wobj0; both requests on one connection."""

    def __init__(self, settings: AbbRwsSettings) -> None:
        import httpx

        self._settings, self._pace = settings, Pace(settings.interval_s)
        self._client = httpx.Client(
            base_url=settings.url.rstrip("/"),
            headers={"Accept": _ACCEPT},
            verify=settings.verify,
            timeout=1.5,
            trust_env=False,
        )
        secret = settings.password.get_secret_value()
        asked = self._client.get("/rw/system").headers.get("www-authenticate", "").lower()
        auth = httpx.DigestAuth if asked.startswith("digest") else httpx.BasicAuth
        self._client.auth = auth(settings.user, secret)

    def describe(self) -> Description:
        """Return what is asked for."""
        has_table = self._settings.table_axis or self._settings.table_unit
        can = ("pose", "joints", *(("table",) if has_table else ()))
        return Description("ABB Robot Web Services", "mm, degrees", "abb", "tool0 in base", can)

    def read(self) -> Sample | None:
        """Return where the flange is; raises InputError, ConnectionError."""
        self._pace.wait()
        chosen = self._settings
        joints = self._state(f"{chosen.unit}/jointtarget", "ms-jointtarget")
        target = self._state(f"{chosen.unit}/robtarget?tool=tool0&wobj=wobj0&coordinate=Base", "ms-robtargets")
        numbers = [target.get(name, math.nan) for name in ("x", "y", "z", "q1", "q2", "q3", "q4")]
        table_deg = axis_number(chosen.table_axis, _external(joints))
        if chosen.table_unit:
            table = self._state(f"{chosen.table_unit}/jointtarget", "ms-jointtarget")
            table_deg = axis_number("E1", _external(table)) if _external(table) else table.get("rax_1")
        axes = tuple(joints[name] for k in range(1, 7) if (name := f"rax_{k}") in joints)
        return Sample(
            host_now_s(), None, parse_pose("abb", numbers), axes or None, table_deg, None, "tool0", "wobj0"
        )

    def close(self) -> None:
        """Log out, so that the controller has the session free, and close the connection."""
        import httpx

        try:
            self._client.get("/logout")
        except httpx.HTTPError:
            pass
        finally:
            self._client.close()

    def _state(self, path: str, kind: str) -> dict[str, float]:
        """Return the numbers by name of a mechanical unit's state."""
        import httpx

        try:
            answer = self._client.get(f"/rw/motionsystem/mechunits/{path}")
        except httpx.HTTPError as error:
            raise ConnectionError(str(error) or type(error).__name__) from None
        if answer.status_code != 200:
            to_do = (
                message("Check user and password.")
                if answer.status_code == 401
                else message("Check unit and RobotWare.")
            )
            raise InputError("an answer to {path}", f"{answer.status_code}", to_do, path, path=path)
        return parse_state(answer.text, kind)


def parse_state(page: str, kind: str) -> dict[str, float]:
    """Return the numbers of a page's ``<li class="ms-robtargets"><span class="x">515</span>…`` by their classes.

    Raises
    ------
    InputError
        If the page has none.
    """
    try:
        root: Any = ElementTree.fromstring(re.sub(r"<!DOCTYPE[^>\[]*>", "", page, count=1))
    except ElementTree.ParseError as error:
        to_do = "Check the address."
        raise InputError("a page of Robot Web Services", "another one ({error})", to_do, error=error) from None
    found: dict[str, float] = {}
    for item in root.iter():
        if item.tag.rpartition("}")[2] == "li" and item.get("class") == kind:
            for span in item.iter():
                try:
                    found[span.get("class", "")] = float(span.text or "")
                except ValueError:
                    continue
    if not found:
        raise InputError("a state of the kind {kind}", "none", "Check the mechanical unit.", kind, kind=kind)
    return found


def _external(joints: dict[str, float]) -> list[float]:
    values = [joints.get(f"eax_{letter}", 9e9) for letter in "abcdef"]
    return [value for value in values if abs(value) < _NO_AXIS]


SOURCE = Source(
    "abb-rws",
    "ABB: Robot Web Services",
    "Asks a controller of ABB for the flange's pose, joints and external axes.",
    AbbRwsSettings,
    connect=AbbRws,
    delivers=("robot", "table"),
)
