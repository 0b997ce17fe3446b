"""The table turned from here: off unless an operator arms it for this session, with limits, a time and a stop."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from calib_core.records.strict_fields import require_known_fields
from server.http.api_router import API, api_router, of_app
from server.live.armed_table import Angle, ArmedTable, ArmedTables, Arming
from server.movers.registry import MOVERS
from server.routes.dependencies import ExistingSession, IdempotencyDep
from server.sources.device import host_now_s

router = api_router("live", API)
_SESSION = "/sessions/{session_id}/table-mover"


class MoverChoice(BaseModel):
    """A mover that this server has."""

    name: str
    title: str
    does: str
    extra: str | None = Field(description="The extra of this package that must be installed.")
    settings: dict[str, Any] = Field(description="The JSON Schema of its settings.")


class Movers(BaseModel):
    """All movers."""

    items: list[MoverChoice]


class TableMover(BaseModel):
    """What is armed for a session; `target_deg` is where the table turns to now."""

    armed: bool
    mover: str | None
    low_deg: float | None
    high_deg: float | None
    seconds_left: float
    target_deg: float | None


class TableTurn(BaseModel):
    """An angle to turn the table to."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"table_deg": 45.0}]})

    table_deg: Angle


class Turned(BaseModel):
    """Where the table came to rest, by its source."""

    table_deg: float


TablesDep = Annotated[ArmedTables, of_app("armed_tables")]


@router.get("/movers", response_model=Movers)
def list_movers() -> dict[str, Any]:
    """List what can move a table, with the JSON Schema of each one's settings."""
    return {"items": [mover.describe() for mover in MOVERS]}


@router.get(_SESSION, response_model=TableMover)
def get_mover(session_id: ExistingSession, tables: TablesDep) -> TableMover:
    """Return what is armed for the session."""
    return _told(tables.get(session_id))


@router.put(_SESSION, response_model=TableMover)
def arm_table(session_id: ExistingSession, body: Arming, tables: TablesDep) -> TableMover:
    """Arm the table's mover for this session, between two angles and for some minutes.

    This is no safety function: the cell's own guards the people in it.  It is disarmed after its time, and after a
    restart of the server.
    """
    require_known_fields(body, "request")
    return _told(tables.arm(session_id, body))


@router.delete(_SESSION, status_code=204)
def disarm_table(session_id: ExistingSession, tables: TablesDep) -> None:
    """Stop the table and disarm its mover."""
    tables.disarm(session_id)


@router.post(f"{_SESSION}/go", response_model=Turned)
def turn_table(
    session_id: ExistingSession, body: TableTurn, _: IdempotencyDep, tables: TablesDep
) -> dict[str, float]:
    """Turn the table to an angle within the limits and wait until it rests there.

    It is stopped where its angle is no longer told, leaves the limits, or does not come closer.
    """
    return {"table_deg": tables.require(session_id).go(body.table_deg)}


@router.post(f"{_SESSION}/stop", status_code=204)
def stop_table(session_id: ExistingSession, tables: TablesDep) -> None:
    """Stop the table now; it stays armed."""
    tables.require(session_id).stop()


def _told(armed: ArmedTable | None) -> TableMover:
    if armed is None:
        return TableMover(armed=False, mover=None, low_deg=None, high_deg=None, seconds_left=0.0, target_deg=None)
    arming = armed.arming
    return TableMover(
        armed=True,
        mover=arming.mover,
        low_deg=arming.low_deg,
        high_deg=arming.high_deg,
        seconds_left=max(0.0, armed.until_s - host_now_s()),
        target_deg=armed.target_deg,
    )
