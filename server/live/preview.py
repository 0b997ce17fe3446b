"""A live cell as the page shows it: states, poses, the thinned profile and the arc in it, as JSON data."""

from datetime import UTC, datetime
from typing import Any

import numpy as np

from server.live.exposures import Exposure
from server.live.link import LinkState
from server.live.live_cell import LiveCell
from server.sources.device import Sample, host_now_s
from server.sources.source import Source
from server.store.models import DeviceRow

_MOST_POINTS = 300


def device_data(
    row: DeviceRow, source: Source | None, secrets: list[str], state: LinkState | None, clock_s: float
) -> dict[str, Any]:
    """Return a device as REST lists it; `clock_s` is what turns `host_now_s` into seconds since 1970."""
    about = state.description if state else None
    return {
        "name": row.name,
        "source": row.source,
        "title": source.title if source else row.source,
        "delivers": list(source.delivers) if source else [],
        "settings": row.settings,
        "secrets": secrets,
        "connected_for": row.session_id,
        "status": state.status if state else "off",
        "problem": _problem(source, row, state),
        "since": _moment(clock_s + state.since_s) if state else None,
        "readings": state.readings if state else 0,
        "refused": state.refused if state else 0,
        "rate_hz": round(state.rate_hz, 1) if state else 0.0,
        "model": about.model if about else "",
        "can": list(about.can) if about else [],
    }


def live_data(live: LiveCell | None) -> dict[str, Any]:
    """Return what a live cell shows at this moment."""
    if live is None:
        return {"devices": [], "automatic": False, "waits_for": "", "robot": None, "table_deg": None}
    robot, table_deg, exposure = live.newest()
    last = live.last
    return {
        "devices": [
            {
                "name": link.name,
                "status": state.status,
                "problem": state.problem,
                "rate_hz": round(state.rate_hz, 1),
            }
            for link in list(live.links.values())
            if (state := link.state())
        ],
        "automatic": live.settings.automatic,
        "waits_for": live.waits_for,
        "robot": None if robot is None else _robot(robot),
        "table_deg": table_deg,
        "exposure": None if exposure is None else _exposure(exposure),
        "last": None
        if last is None
        else {"id": last.capture, "verdict": last.verdict, "zone": last.zone, "text": last.text},
    }


def _robot(sample: Sample) -> dict[str, Any]:
    pose = sample.base_from_tool0
    return {
        "base_from_tool0": None if pose is None else pose.to_rows(),
        "joints_deg": None if sample.joints_deg is None else list(sample.joints_deg),
        "moving": sample.moving,
        "active_tool": sample.active_tool,
        "active_frame": sample.active_frame,
        "device_time_s": sample.device_time_s,
        "age_s": round(host_now_s() - sample.host_time_s, 3),
    }


def _exposure(exposure: Exposure) -> dict[str, Any]:
    points = exposure.points[np.isfinite(exposure.points).all(axis=1)]
    chosen = np.linspace(0, max(len(points) - 1, 0), min(len(points), _MOST_POINTS)).astype(int)
    arc = exposure.arc
    return {
        "name": exposure.frame.name,
        "age_s": round(host_now_s() - exposure.frame.host_time_s, 3),
        "points": np.round(points[chosen], 3).tolist(),
        "circle": None if arc is None else [*np.round(arc.center_mm, 4).tolist(), round(arc.radius_mm, 4)],
        "rms_mm": None if arc is None else round(arc.rms_mm, 5),
        "extent_deg": None if arc is None else round(float(np.rad2deg(arc.extent_rad)), 1),
        "zone": None if exposure.zone is None else round(exposure.zone, 4),
        "problem": exposure.problem,
        "weak": exposure.weak,
    }


def _problem(source: Source | None, row: DeviceRow, state: LinkState | None) -> str:
    if source is None:
        return f"This server has no source '{row.source}': install the package that brings it."
    return state.problem if state else ""


def _moment(since_1970_s: float) -> str:
    return datetime.fromtimestamp(since_1970_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
