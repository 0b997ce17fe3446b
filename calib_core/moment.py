"""Moments as ISO 8601 text in UTC, to the millisecond: it sorts as time runs."""

from datetime import UTC, datetime, timedelta


def text_of(moment: datetime) -> str:
    """Return a moment as such text."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def text_of_seconds(since_1970_s: float) -> str:
    """Return a moment of the system's clock as such text."""
    return text_of(datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=since_1970_s))  # Windows' own ends there


def now() -> str:
    """Return the present moment as such text."""
    return text_of(datetime.now(UTC))


def from_now(span: timedelta) -> str:
    """Return the moment a span of time after the present one, before it where that is negative, as such text."""
    return text_of(datetime.now(UTC) + span)


def said_moment(moment: str) -> str:
    """Return a moment (ISO 8601) as people write it, with its offset from UTC; as it is where it is none."""
    try:
        when = datetime.fromisoformat(moment)
    except ValueError:
        return moment
    offset = (when if when.tzinfo else when.replace(tzinfo=UTC)).strftime("%z")
    return f"{when:%Y-%m-%d %H:%M} UTC{'' if offset == '+0000' else f'{offset[:3]}:{offset[3:]}'}"
