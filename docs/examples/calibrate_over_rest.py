"""Calibrates the scanner of a session folder through a running workbench.

    python calibrate_over_rest.py path/to/session [http://127.0.0.1:8000]

Needs httpx (`pip install httpx`).  Every POST carries an Idempotency-Key: run it again after a broken connection and
nothing is stored twice.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import httpx


def main(folder: Path, address: str) -> dict[str, Any]:
    """Make the session, send its captures, solve, and return the result."""
    record = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    captures = record.pop("captures")
    run = f"{folder.resolve()} {time.time_ns()}"  # names this run in the keys

    with httpx.Client(base_url=f"{address}/api/v1", timeout=60) as api:

        def post(path: str, **body: Any) -> dict[str, Any]:
            answer = api.post(path, headers={"Idempotency-Key": f"{run} {body.pop('key', path)}"}, **body)
            if answer.is_error:
                sys.exit(f"{path}: {answer.json()['detail']}")  # says what is wrong and what to do
            return answer.json()

        session = post("/sessions", json=record)["id"]
        for capture in captures:
            parts = [("files", (name, (folder / name).read_bytes())) for name in capture.get("files", [])]
            parts.append(("record", (None, json.dumps(capture).encode())))
            measured = post(f"/sessions/{session}/captures", files=parts, key=capture["id"])["measured"]
            print(f"{capture['id']}: {measured['verdict']}  {measured.get('reason') or ''}".rstrip())

        job = post(f"/sessions/{session}/solve/tcp")
        while job["status"] in ("queued", "running"):
            time.sleep(0.1)
            job = api.get(f"/jobs/{job['id']}").json()
        if job["status"] != "done":
            sys.exit(f"solve {job['status']}: {(job['error'] or {}).get('detail', '')}")
        return api.get(f"/sessions/{session}/results/tcp").json()


if __name__ == "__main__":
    result = main(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "http://127.0.0.1:8000")
    print(f"verdict {result['verdict']}, centre scatter {result['center_scatter_rms_mm']:.3f} mm")
    for row in result["tool0_from_laser"]:
        print("  ".join(f"{value:12.6f}" for value in row))
