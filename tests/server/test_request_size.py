"""A request that is too large, whether it says so or not, is refused, and nothing of it is stored."""

import json
from collections.abc import Iterator

import httpx

from tests.server.live_server import assert_problem, make_session, upload

POSE = [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]
RECORD = {"id": "p01", "step": "tcp", "kind": "profile", "pose": POSE}


def test_too_large_an_upload_is_refused(client: httpx.Client) -> None:
    session = make_session(client)

    def unannounced() -> Iterator[bytes]:
        head = 'Content-Disposition: form-data; name="record"\r\n\r\n' + json.dumps(RECORD)
        part = 'Content-Disposition: form-data; name="files"; filename="a.csv"\r\n\r\n'
        yield f"--b\r\n{head}\r\n--b\r\n{part}".encode()
        for _ in range(2000):
            yield b"1.0,2.0\n" * 12_500

    form = {"Content-Type": "multipart/form-data; boundary=b"}
    answer = client.post(f"/sessions/{session}/captures", content=unannounced(), headers=form)
    assert_problem(answer, 413, "2000000")
    announced = upload(client, session, RECORD, b"1.0,2.0\n" * 400_000)
    assert_problem(announced, 413, "2000000")
    assert client.get(f"/sessions/{session}/captures").json()["items"] == []
