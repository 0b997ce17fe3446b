"""A live cell as the page shows it: states, poses, the thinned profile and the arc in it, as JSON data."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.findings import sentence_of
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.moment import text_of_seconds
from server.live.exposures import Exposure
from server.live.link import LinkState
from server.live.live_cell import LiveCell
from server.live.pictures import Picture
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
        "fresh": state.fresh if state else False,
        "why": state.why if state else "",
        "since": text_of_seconds(clock_s + state.since_s) if state else None,
        "readings": state.readings if state else 0,
        "refused": state.refused if state else 0,
        "rate_hz": round(state.rate_hz, 1) if state else 0.0,
        "model": about.model if about else "",
        "can": list(about.can) if about else [],
    }


Newest = tuple[Sample | None, float | None, Exposure | None]


def live_data(live: LiveCell | None, newest: Newest | None = None) -> dict[str, Any]:
    """Return what a live cell shows at this moment, or with readings that are `newest` already."""
    if live is None:
        nothing = dict.fromkeys(("robot", "table_deg", "exposure", "clocks", "last"))
        told = {"version": 0, "step": "", "devices": [], "automatic": False, "waits_for": "", "is_taken": False}
        return told | nothing
    robot, table_deg, exposure = newest or live.newest()
    last = live.last
    return {
        "version": live.version,
        "step": live.settings.step,
        "devices": [
            {
                "name": link.name,
                "delivers": list(link.source.delivers),
                "status": state.status,
                "problem": state.problem,
                "fresh": state.fresh,
                "why": state.why,
                "rate_hz": round(state.rate_hz, 1),
                "age_s": round(host_now_s() - state.heard_s, 2),
            }
            for link in list(live.links.values())
            if (state := link.state())
        ],
        "automatic": live.settings.automatic,
        "waits_for": live.waits_for,
        "is_taken": live.is_taken,
        "robot": None if robot is None else _robot(robot),
        "table_deg": table_deg,
        "exposure": None if exposure is None else _exposure(exposure),
        "clocks": _clocks(live),
        "last": None
        if last is None
        else {"id": last.capture, "verdict": last.verdict, "zone": last.zone, "text": last.text},
    }


def _clocks(live: LiveCell) -> dict[str, Any] | None:
    found = live.clocks.offset
    if found is None:
        return None
    drift_s, warning = live.clock_watch.drift_s, live.clock_watch.warning
    return {"offset_s": found.offset_s, "sigma_s": found.sigma_s, "drift_s": round(drift_s, 4), "warning": warning}


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
    finite = np.flatnonzero(np.isfinite(exposure.points).all(axis=1))
    chosen = finite[_thinned(len(finite), _MOST_POINTS)]
    points = exposure.points[chosen]
    arc = exposure.arc
    return {
        "name": exposure.frame.name,
        "age_s": round(host_now_s() - exposure.frame.host_time_s, 3),
        "points": np.round(points, 3).tolist(),
        "on_arc": [] if arc is None else arc.inliers[chosen].tolist(),
        "circle": None if arc is None else [*np.round(arc.center_mm, 4).tolist(), round(arc.radius_mm, 4)],
        "rms_mm": None if arc is None else round(arc.rms_mm, 5),
        "extent_deg": None if arc is None else round(float(np.rad2deg(arc.extent_rad)), 1),
        "zone": None if exposure.zone is None else round(exposure.zone, 4),
        "problem": exposure.problem,
        "weak": "" if exposure.weak is None else sentence_of(exposure.weak),
        "findings": [] if exposure.weak is None else [exposure.weak.to_json()],
        "picture": None if exposure.picture is None else _picture(exposure.picture, exposure.arc_px),
    }


def _picture(picture: Picture, arc_px: FloatArray | None) -> dict[str, Any]:
    stripe = picture.stripe
    pixels = np.empty((0, 2)) if stripe is None else stripe.pixels[_thinned(len(stripe.pixels), _MOST_POINTS)]
    return {
        "size": list(picture.size),
        "stripe": np.round(pixels, 1).tolist(),
        "arc": [] if arc_px is None else np.round(arc_px, 1).tolist(),
        "stripe_width_px": None if stripe is None else round(stripe.width_px, 2),
        "brightness": round(picture.brightness, 3),
        "saturated": round(picture.saturated, 3),
        "exposure_advice": picture.exposure_advice,
        "focus_advice": picture.focus_advice,
    }


def _thinned(count: int, most: int) -> NDArray[np.intp]:
    return np.linspace(0, max(count - 1, 0), min(count, most)).astype(np.intp)


def _problem(source: Source | None, row: DeviceRow, state: LinkState | None) -> str:
    if source is None:
        return message(
            "This server has no source '{source}': install the package that brings it.", source=row.source
        )
    return state.problem if state else ""
