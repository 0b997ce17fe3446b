"""Calibrates the scanner of a session folder through a running workbench.

    python calibrate_over_rest.py path/to/session [http://127.0.0.1:8000]

Needs httpx (`pip install httpx`).
"""

import json
import sys
import time
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx


def post(api: httpx.Client, path: str, **body: Any) -> dict[str, Any]:
    """Send a request; after a broken connection again, which the Idempotency-Key makes safe."""
    headers = {"Idempotency-Key": str(uuid4())}
    for attempt in range(5):
        try:
            answer = api.post(path, headers=headers, **body)
            break
        except httpx.TransportError:
            if attempt == 4:
                raise
            time.sleep(2**attempt)
    if answer.is_error:
        sys.exit(f"{path}: {answer.json()['detail']}")  # what is wrong and what to do
    return answer.json()


def calibrate(folder: Path, api: httpx.Client) -> dict[str, Any]:
    """Make the session, send its captures, solve, and return the result."""
    record = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    captures = record.pop("captures")
    session = post(api, "/sessions", json=record)["id"]
    for capture in captures:
        parts: list[Any] = [("record", (None, json.dumps(capture).encode()))]
        parts += [("files", (name, (folder / name).read_bytes())) for name in capture.get("files", [])]
        measured = post(api, f"/sessions/{session}/captures", files=parts)["measured"]
        print(capture["id"], measured["verdict"], measured.get("reason") or "")
    job = post(api, f"/sessions/{session}/solve/tcp")
    while job["status"] in ("queued", "running"):
        time.sleep(0.1)
        job = api.get(f"/jobs/{job['id']}").json()
    if job["status"] != "done":
        sys.exit(f"{job['status']}: {(job['error'] or {}).get('detail', '')}")
    return api.get(f"/sessions/{session}/results/tcp").json()


if __name__ == "__main__":
    address = sys.argv[2] if len(sys.argv) > 2 else "http://127.0.0.1:8000"
    with httpx.Client(base_url=f"{address}/api/v1", timeout=60) as client:
        result = calibrate(Path(sys.argv[1]), client)
    print(f"verdict {result['verdict']}, centre scatter {result['center_scatter_rms_mm']:.3f} mm")
    for row in result["tool0_from_laser"]:
        print("  ".join(f"{value:12.6f}" for value in row))
