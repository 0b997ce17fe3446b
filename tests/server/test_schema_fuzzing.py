"""Whatever the published schema allows, and much that it does not: no request may end in a 500."""

from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tests.server.live_server import simulated_session

# Streams do not end; they have tests of their own.  Solves are started by those of the jobs.
LEFT_OUT = ("/events", "/solve/")
EXAMPLES = 2


@pytest.mark.thorough
def test_no_request_of_the_schema_ends_in_a_500(client: httpx.Client) -> None:
    assert sum(fuzzed(client, EXAMPLES).values()) >= 50 * EXAMPLES / 2


def fuzzed(client: httpx.Client, examples: int, owner: httpx.Client | None = None) -> dict[str, int]:
    """Send so many requests to each operation of the schema; return how many each has answered.

    They go with the rights of `client`; where it has few, `owner` makes what they ask for.
    """
    import schemathesis  # a second, for this test alone

    owner = owner or client
    site = str(client.base_url).removesuffix("/api/v1/")
    schema = schemathesis.openapi.from_dict(owner.get(f"{site}/openapi.json").json())
    operations = [result.ok() for result in schema.get_all_operations()]
    tried = [o for o in operations if not any(s in o.path for s in LEFT_OUT)]
    assert len(tried) >= 50
    answered: dict[str, int] = {}
    session = ""
    for operation in tried:
        if not _is_whole(owner, session):
            session = simulated_session(owner, captures=2)
        there = {
            "session_id": session,
            "session": session,
            "capture_id": "p01",
            "stage": "tcp",
            "viewer": "page4711",
        }
        answered[operation.label] = _fuzz(operation, client, there, examples)
        assert answered[operation.label], operation.label
    return answered


def _is_whole(client: httpx.Client, session: str) -> bool:
    """Whether no operation has taken away what others ask for."""
    return bool(session) and client.get(f"/sessions/{session}/captures/p01").status_code == 200


def _fuzz(operation: Any, client: httpx.Client, there: dict[str, str], examples: int) -> int:
    answered = 0
    site = str(client.base_url).removesuffix("/api/v1/")
    rights = {name: client.headers[name] for name in ("Authorization",) if name in client.headers}

    @settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy())
    def check(case: Any) -> None:
        nonlocal answered
        # Names that are there: else every request would end at a 404.
        if answered % 4 and case.path_parameters:
            case.path_parameters = {name: there.get(name, value) for name, value in case.path_parameters.items()}
        answer = case.call(base_url=site, timeout=30, headers=rights)
        answered += 1
        assert answer.status_code < 500, f"{operation.label}: {answer.text}\n{case.as_curl_command()}"
        if answer.status_code >= 400:
            assert answer.headers["content-type"] == ["application/problem+json"], answer.text

    check()
    return answered


@pytest.mark.parametrize("path", ["/sessions", "/sessions/x/captures", "/sessions/x/pose-lines"])
@pytest.mark.parametrize(
    "content_type", ["application/json", "text/plain", "multipart/form-data", "", "a/b; c=\xff"]
)
def test_bodies_of_another_kind_are_refused(client: httpx.Client, path: str, content_type: str) -> None:
    answer = client.post(path, content=b"\x00\xff{", headers={"Content-Type": content_type.encode("latin-1")})
    assert answer.status_code in (400, 404, 413, 415, 422), answer.text
    assert answer.headers["content-type"] == "application/problem+json"
