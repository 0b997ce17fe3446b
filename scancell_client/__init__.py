"""The workbench's client: a session, its captures, its results and events from Python, over REST.

from scancell_client import Scancell

with Scancell("http://127.0.0.1:8000") as api:
    session = api.sessions_create({"cell": {"pose_convention": "fanuc", "sphere_diameter_mm": 80.0}})["id"]
    api.captures_add(session, capture, {"p01.csv": content})
    result = api.solve(session, "tcp")["tcp"]
    print(result.verdict, result.tool0_from_laser)
"""

from .connection import Event, ProblemError, UnavailableError
from .scancell import Scancell

__all__ = ["Event", "ProblemError", "Scancell", "UnavailableError"]
