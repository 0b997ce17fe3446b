"""Examples of the API, recorded from the real server as it takes the simulated cell through the whole chain.

`PYTHONPATH=. python tests/web/api_examples.py` writes them to server/http/api_examples.json, from where they go
into the OpenAPI document; a test says which operations have none, or ones that their schema does not allow. What
it does not record (cells, releases, stories) stays as it stands there.
"""

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx

from server.settings import Settings
from tests.server.live_rig import rig
from tests.server.live_server import serving, wait_for

TARGET = Path(__file__).resolve().parents[2] / "server" / "http" / "api_examples.json"
_LONG = 16
_KEPT = 2
_STAGES = ("tcp", "turntable", "chain", "merge")
_POSE = [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]
FOLDER = "cell 4/today"
_TETRAHEDRON = (
    ((0, 0, 0), (0, 40, 0), (40, 0, 0)),
    ((0, 0, 0), (40, 0, 0), (0, 0, 40)),
    ((0, 0, 0), (0, 0, 40), (0, 40, 0)),
    ((40, 0, 0), (0, 40, 0), (0, 0, 40)),
)
_UNITY = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
_CELL = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0}


class Recorder:
    """Sends requests and keeps what was sent and answered, by operation."""

    def __init__(self, client: httpx.Client) -> None:
        self._client = client
        self._site = str(client.base_url).removesuffix("/api/v1/")
        self._operations = {
            (method.upper(), path): operation["operationId"]
            for path, operations in client.get(f"{self._site}/openapi.json").json()["paths"].items()
            for method, operation in operations.items()
        }
        self.examples: dict[str, dict[str, Any]] = {}

    def send(
        self, method: str, template: str, body: Any = None, names: dict[str, Any] | None = None, **more: Any
    ) -> Any:
        """Send a request to a path's template and return the answer's data."""
        if body is not None:
            more["json"] = body
        answer = self._client.request(method, self._site + template.format(**(names or {})), **more)
        assert answer.is_success, (method, template, answer.text)
        kept: dict[str, Any] = {} if body is None else {"request": body}
        data = None
        if answer.content and answer.headers.get("content-type", "") == "application/json":
            data = answer.json()
            kept["answer"] = shortened(data)
        self.examples.setdefault(self._operations[method, template], kept)
        return data


def shortened(data: Any) -> Any:
    """Return data with long lists cut: of records after two, of numbers after sixteen."""
    if isinstance(data, dict):
        return {name: shortened(value) for name, value in data.items()}
    if isinstance(data, list):
        first = data[0] if data else None
        records = isinstance(first, dict) or (isinstance(first, list) and first and isinstance(first[0], list))
        few = data[:_KEPT] if records or len(data) > _LONG else data
        return [shortened(value) for value in few]
    return data


def record(client: httpx.Client) -> dict[str, dict[str, Any]]:
    """Return an example of each operation whose answer is JSON."""
    recorder = Recorder(client)
    send, api, session = recorder.send, "/api/v1", "/api/v1/sessions/{session_id}"
    simulated = {"name": "trial", "simulated": {"scenario": "cell", "seed": 7}}
    there = send("POST", f"{api}/sessions", simulated)["id"]
    names: dict[str, Any] = {"session_id": there, "session": there}
    send("POST", f"{session}/sources/simulated/capture", names=names)
    while client.post(f"/sessions/{there}/sources/simulated/capture").status_code == 201:
        pass
    for stage in _STAGES:
        names["stage"] = stage
        names["job_id"] = send("POST", f"{session}/solve/{{stage}}", names=names)["id"]
        assert wait_for(client, names["job_id"], 600)["status"] == "done"
    send("GET", f"{api}/jobs/{{job_id}}", names=names)
    send("GET", f"{api}/jobs", params={"limit": 2})
    for what in ("formats", "conventions", "exports", "sources", "stages", "findings"):
        send("GET", f"{api}/{what}")
    send("GET", f"{api}/findings/{{code}}", names={"code": "stored-note"})
    _causes(recorder, client)
    waiting = client.post(f"/sessions/{there}/solve/chain").json()["id"]
    send("POST", f"{api}/jobs/{{job_id}}/cancel", names={"job_id": waiting})
    names |= {"stage": "tcp", "capture_id": "p01", "place": 3}
    for path in (
        "",
        "/guide",
        "/check",
        "/captures",
        "/captures/{capture_id}",
        "/results",
        "/timeline",
        "/clouds",
    ):
        send("GET", session + path, names=names)
    for path in ("/results/{stage}", "/results/{stage}/history", "/truth/{stage}", "/timeline/{place}"):
        send("GET", session + path, names=names)
    listed = recorder.examples["solves_list_results"]["answer"]
    recorder.examples["solves_list_results"]["answer"] = {"tcp": listed["tcp"]}  # one is enough
    history = client.get(f"/sessions/{there}/results/tcp/history").json()
    names["number"] = history["items"][0]["number"]
    send("GET", f"{session}/results/{{stage}}/history/{{number}}", names=names)
    send("GET", f"{session}/merged/section", names=names, params={"axis": "z", "at_mm": 30.0})
    send("GET", f"{session}/merged/deviation", names=names, params={"against": "sphere"})
    send("GET", f"{session}/frames", names=names, params={"into": "turntable", "outof": "laser", "capture": "p01"})
    send("GET", f"{session}/budget", names=names)
    recorder.examples["cells_get_released"] = {"answer": send("GET", f"{session}/answer", names=names)}
    send("GET", f"{session}/planned", names=names, params={"captures": 3})
    send("GET", f"{session}/recheck", names=names)
    field = {"near_mm": 130, "far_mm": 230, "near_width_mm": 60}
    send("POST", f"{api}/plan", {"scanner": field, "sphere_diameter_mm": 40, "wanted_mm": 0.2})
    sides = {"left": there, "right": there}
    send("GET", f"{api}/compare/{{stage}}", names=names, params=sides)
    replay = send("POST", f"{session}/replay", names=names)
    assert wait_for(client, replay["id"], 600)["status"] == "done"
    send("GET", f"{api}/jobs/{{job_id}}/answer", names={"job_id": replay["id"]})
    send("PATCH", session, {"name": "cell 4, morning"}, names)
    send("PATCH", f"{session}/captures/{{capture_id}}", {"excluded": True}, names)
    send("POST", f"{session}/pose-lines", {"text": "-195.8 1363.305 524.812 -179.924 0.889 179.635"}, names)
    archive = client.get(f"/sessions/{there}/archive", params={"scene": False}).content
    zipped: dict[str, Any] = {"content": archive, "headers": {"Content-Type": "application/zip"}}
    send("POST", f"{api}/archives/verify", **zipped)
    send("POST", f"{api}/archives", **zipped)
    send("GET", f"{api}/sessions", params={"limit": 2})
    _uploads(recorder, names)
    _of_this_machine(recorder, names)
    send("GET", f"{api}/me")
    token = send("POST", f"{api}/tokens", {"name": "robot 2", "role": "capture"})
    send("GET", f"{api}/tokens/{{token_id}}", names={"token_id": token["id"]})
    recorder.examples["access_make"]["answer"]["secret"] = "scancell_…"
    send("GET", f"{api}/tokens")
    send("GET", f"{api}/audit", params={"limit": 2})
    recorder.examples["access_log_in"] = {"answer": recorder.examples["access_me"]["answer"]}
    machines(recorder, names)
    client.delete(f"/tokens/{token['id']}")
    webhook_examples(recorder)
    send("GET", f"{api}/health")
    send("GET", "/health")
    return recorder.examples


def webhook_examples(recorder: Recorder) -> None:
    """Record a webhook from its making to its end."""
    of_one = "/api/v1/webhooks/{webhook_id}"
    body = {"url": "https://plc.example/scancell", "events": ["result", "verdict"], "name": "PLC of cell 4"}
    names = {"webhook_id": recorder.send("POST", "/api/v1/webhooks", body)["id"]}
    recorder.examples["webhooks_make"]["answer"]["secret"] = "whsec_…"
    recorder.send("GET", "/api/v1/webhooks")
    recorder.send("GET", of_one, names=names)
    recorder.send("POST", f"{of_one}/ping", names=names)
    recorder.send("GET", f"{of_one}/deliveries", names=names)
    recorder.send("DELETE", of_one, names=names)


def _causes(recorder: Recorder, client: httpx.Client) -> None:
    """Take a TCP whose poses are told in another convention, and mend it."""
    simulated = {"name": "wrong convention", "simulated": {"scenario": "tcp", "seed": 11}}
    there = client.post("/sessions", json=simulated).json()["id"]
    while client.post(f"/sessions/{there}/sources/simulated/capture").status_code == 201:
        pass
    client.patch(f"/sessions/{there}", json={"cell": {"pose_convention": "quaternion-xyzw"}}).raise_for_status()
    job = client.post(f"/sessions/{there}/solve/tcp").json()["id"]
    assert wait_for(client, job, 600)["status"] == "done"
    session, names = "/api/v1/sessions/{session_id}", {"session_id": there}
    found = recorder.send("GET", f"{session}/causes", names=names)
    names["cause_id"] = found["items"][0]["id"]
    recorder.send("POST", f"{session}/causes/{{cause_id}}/apply", names=names)
    recorder.send("POST", f"{session}/changes", {"captures": {"p01": {"excluded": True}}}, names)


def _uploads(recorder: Recorder, names: dict[str, Any]) -> None:
    mine = recorder.send("POST", "/api/v1/sessions", {"name": "cell 4", "cell": _CELL})["id"]
    content = b"x_mm,z_mm\n" + b"".join(
        b"%.1f,%.4f\n" % (x / 10, 150 - (225 - x * x / 100) ** 0.5) for x in range(-120, 121)
    )
    record = {"id": "p01", "step": "tcp", "kind": "profile", "files": ["captures/p01.csv"], "pose": _POSE}
    parts = {"record": (None, json.dumps(record)), "files": ("p01.csv", content)}
    to = {"session_id": mine}
    recorder.send("POST", "/api/v1/sessions/{session_id}/captures", names=to, files=parts)
    line = (
        json.dumps({**record, "id": "p02", "files": ["captures/p02.csv"], "sizes": [len(content)]}).encode()
        + b"\n"
    )
    recorder.send("POST", "/api/v1/sessions/{session_id}/captures/batch", names=to, content=line + content)


def machines(recorder: Recorder, names: dict[str, Any]) -> None:
    """Record what is looked at before it is used, and the tool read back."""
    recorder.send("GET", "/api/v1/brands")
    recorder.send("GET", "/api/v1/arms")
    points = "DEFDAT measure\n" + "".join(
        f"DECL E6POS XP{k}={{X {800 + k}.0,Y 20.0,Z 600.0,A 0.0,B 90.0,C 0.0,S 2,T 3,E1 {45 * k}.0}}\n"
        f'DECL FDAT FP{k}={{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}}\n'
        for k in (1, 2)
    )
    config = "TOOL_DATA[1]={X 0.0,Y 0.0,Z 184.0,A 0.0,B 0.0,C 0.0}\nLOAD_DATA[1]={M 1.0}\n"
    files = [("files", ("measure.dat", f"{points}ENDDAT\n".encode())), ("files", ("$config.dat", config.encode()))]
    recorder.send("POST", "/api/v1/controller-files", files=files)
    profile = "x,z\n" + "".join(f"{x / 10:.1f},{150 + x * x / 900:.4f}\n" for x in range(-30, 31))
    recorder.send("POST", "/api/v1/readings", files={"file": ("p01.csv", profile.encode())})
    typed = {"numbers": (None, "0 0 184 0 0 0"), "convention": (None, "kuka")}
    recorder.send("POST", "/api/v1/sessions/{session_id}/read-back", names=names, files=typed)


def _of_this_machine(recorder: Recorder, names: dict[str, Any]) -> None:
    """Record what needs a folder that is watched, a mesh, or a scene."""
    session = "/api/v1/sessions/{session_id}"
    recorder.send("PUT", f"{session}/sources/folder", {"folder": FOLDER, "step": "tcp"}, names)
    recorder.send("GET", f"{session}/sources/folder", names=names)
    recorder.send("DELETE", f"{session}/sources/folder", names=names)
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corner) for corner in triangle)
        + "endloop\nendfacet\n"
        for triangle in _TETRAHEDRON
    )
    mesh = {"file": ("part.stl", f"solid part\n{facets}endsolid part\n".encode())}
    recorder.send("PUT", f"{session}/merged/reference", names=names, files=mesh)
    recorder.send("DELETE", f"{session}/merged/reference", names=names)
    recorder.send("GET", "/scenes/{session}/controls", names=names)


def record_live(recorder: Recorder, folder: Path) -> None:
    """Record what needs a robot and a scanner: the simulated ones."""
    session = "/api/v1/sessions/{session_id}"
    cell = {"pose_convention": "abb", "sphere_diameter_mm": 40.0}
    made = recorder.send("POST", "/api/v1/sessions", {"name": "live", "cell": cell})
    names = {"session_id": made["id"], "device": "robot"}
    with rig(folder) as there:
        there.go(there.good[0])
        robot = {"host": "127.0.0.1", "port": there.robot.port, "convention": "abb"}
        recorder.send("PUT", f"{session}/devices/{{device}}", {"source": "pose-lines", "settings": robot}, names)
        scanner = {"source": "frame-folder", "settings": {"folder": str(folder)}}
        recorder.send("PUT", f"{session}/devices/{{device}}", scanner, {**names, "device": "scanner"})
        recorder.send("PUT", f"{session}/live", {"automatic": False, "step": "tcp"}, names)
        time.sleep(2.0)
        recorder.send("GET", f"{session}/devices", names=names)
        recorder.send("GET", "/api/v1/robot-programs")
        recorder.send("POST", f"{session}/live/capture", {"id": "p07"}, names)
        recorder.send("PUT", f"{session}/robot-port", {"port": 0, "allowed": ["127.0.0.1"]}, names)
        recorder.send("GET", f"{session}/robot-port", names=names)
        recorder.send("DELETE", f"{session}/robot-port", names=names)
        for device in ("robot", "scanner"):
            recorder.send("DELETE", f"{session}/devices/{{device}}", names={**names, "device": device})
    clocks = "scanner: device, robot: device"  # devices with clocks of their own are not at hand here
    measured = {"offset_s": 0.03702, "sigma_s": 0.00004, "rms_mm": 0.019, "exposures": 138, "clocks": clocks}
    recorder.examples["machines_read_sphere_certificate"] = {
        "request": {"xml": "<dcc:digitalCalibrationCertificate …"},
        "answer": {
            "identifier": "K-123",
            "equipment": {"kind": "sphere", "certificate": {"number": "K-123"}},
            "diameters": [
                {
                    "name": "Diameter",
                    "diameter_mm": 38.0997,
                    "sigma_mm": 0.0002,
                    "coverage_factor": 2.0,
                    "line": 12,
                }
            ],
        },
    }
    joint = {"kind": "revolute", "name": "joint_1", "previous_from_joint": _UNITY, "limits": [-180.0, 180.0]}
    recorder.examples["machines_read_arm"] = {
        "request": {"xml": "<robot name='arm'> …", "name": "arm.urdf"},
        "answer": {"joints": [joint], "last_from_tool0": _UNITY, "source": "arm.urdf: base → tool0"},
    }
    recorder.examples["live_measure_clocks"] = {
        "answer": {**measured, "shift_at_100_mm_s_mm": 0.004, "warning": ""}
    }
    recorder.examples["live_take_sweep"] = {
        "request": {"id": "p08", "seconds": 2.0},
        "answer": {"id": "p08", "verdict": "pass", "zone": 0.71, "text": ""},
    }
    armed = {"armed": True, "mover": "modbus-table", "low_deg": 0.0, "high_deg": 350.0}
    settings = {"host": "192.168.0.30", "target": 200, "start": 20, "stop": 21}
    told = {**armed, "seconds_left": 900.0, "target_deg": None}
    arming = {"mover": "modbus-table", "settings": settings, "low_deg": 0.0, "high_deg": 350.0, "minutes": 15.0}
    recorder.examples["live_arm_table"] = {
        "request": arming,
        "answer": told,
    }  # no table that turns is at hand here
    recorder.examples["live_get_mover"] = {"answer": told}
    recorder.examples["live_turn_table"] = {"request": {"table_deg": 45.0}, "answer": {"table_deg": 45.0}}
    recorder.send("GET", "/api/v1/movers")
    text = json.dumps(recorder.examples).replace(str(folder), "/mnt/scanner/today")
    recorder.examples |= json.loads(text)


def main() -> None:
    """Write the examples."""
    with tempfile.TemporaryDirectory() as data, serving(_settings(Path(data))) as client:
        client.timeout = httpx.Timeout(600)
        examples = record(client)
        recorder = Recorder(client)
        record_live(recorder, Path(data) / "exposures")
        examples = {**recorder.examples, **examples}
    write(examples)


def _settings(place: Path) -> Settings:
    (place / "hall" / FOLDER).mkdir(parents=True)
    return Settings(data=place / "d", port=0, watch_root=place / "hall")


def write(examples: dict[str, dict[str, Any]]) -> None:
    """Write examples where the OpenAPI document takes them from, beside those that stand there alone."""
    examples = {**json.loads(TARGET.read_text(encoding="utf-8")), **examples}
    told = {name: json.dumps(examples[name], ensure_ascii=False, sort_keys=True) for name in sorted(examples)}
    lines = ",\n".join(f'"{name}": {text}' for name, text in told.items())
    TARGET.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
