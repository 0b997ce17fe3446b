"""The compose file's services as processes, with its own commands: from the first token to an answer kept."""

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import pytest

from tests.package.test_image import BIN, COMPOSE, ROOT, instructions
from tests.server.live_server import simulated_session, wait_for
from tests.server.postgres import free_port, new_database, running_postgres
from tests.server.s3 import running_s3

Run = Callable[[str, Sequence[str]], "subprocess.Popen[bytes]"]


@contextmanager
def deployed(folder: Path) -> Iterator[tuple[Run, str]]:
    """Give what runs a command as one of the services does, and the workbench's address.

    Names of services and volumes are places on this machine here; no other word of the files is changed.  The
    database and the S3 store are of other makes than there: their own images are not ours to test.
    """
    with running_postgres() as postgres, running_s3() as objects, ExitStack() as stack:
        port, scheduler = free_port(), free_port()
        database = new_database(postgres, "compose").removeprefix("postgresql://")
        here = [
            (r"\$\{\w+:-(.*?)\}", r"\1"),
            (r"(?<=psycopg://).*", database),
            ("http://objects:8333", objects),
            ("scheduler:8786", f"127.0.0.1:{scheduler}"),
            (r"^8786$", str(scheduler)),
            (r"^8000$", str(port)),
            (":8000/", f":{port}/"),
            (r"^/(data|keys)", rf"{folder}/\1"),
        ]

        def placed(word: str) -> str:
            for name, place in here:
                word = re.sub(name, place, word)
            return word

        def run(service: str, words: Sequence[str]) -> "subprocess.Popen[bytes]":
            given = COMPOSE["services"][service].get("environment", {})
            environment = {name: placed(value) for name, value in given.items()}
            environment |= {"AWS_EC2_METADATA_DISABLED": "true", "SCANCELL_LOG": "json", "PYTHONUNBUFFERED": "1"}
            program, *arguments = map(placed, words)
            with (folder / f"{service}.log").open("ab") as log:
                process = subprocess.Popen(
                    [str(BIN / program), *arguments],
                    env={**os.environ, **environment},
                    cwd=folder,
                    stdout=subprocess.PIPE,
                    stderr=log,
                )
            stack.callback(_end, process)
            return process

        yield run, f"http://127.0.0.1:{port}"


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    process.communicate()


def first_words() -> list[str]:
    """The command of the file's first lines that makes the first token, as it runs in the container."""
    line = next(line for line in (ROOT / "compose.yaml").read_text().splitlines() if "token create" in line)
    return line.partition("compose run --rm workbench ")[2].split()


def words_of(service: str) -> list[str]:
    return COMPOSE["services"][service].get("command") or json.loads(dict(instructions())["CMD"])


def until_ready(client: httpx.Client, process: "subprocess.Popen[bytes]", log: Path) -> None:
    end_s = time.monotonic() + 300
    while True:
        with suppress(httpx.TransportError):
            if client.get("/health").json()["status"] == "ready":
                return
        assert process.poll() is None, log.read_text()[-3000:]
        assert time.monotonic() < end_s, log.read_text()[-3000:]
        time.sleep(0.1)


@pytest.mark.thorough
def test_the_services_run_from_the_first_token_on_and_what_is_solved_stays_solved(tmp_path: Path) -> None:
    health = json.loads(dict(instructions())["HEALTHCHECK"].partition("CMD ")[2])
    grace_s = int(COMPOSE["services"]["workbench"]["stop_grace_period"].removesuffix("s"))
    with deployed(tmp_path) as (run, address):
        bucket, *_ = (run(service, words_of(service)) for service in ("bucket", "scheduler", "worker"))
        assert bucket.wait(timeout=300) == 0, (tmp_path / "bucket.log").read_text()
        made, _ = run("workbench", first_words()).communicate(timeout=300)  # once what it depends on is there
        token = made.decode().split()[-1]
        workbench = run("workbench", words_of("workbench"))
        api = f"{address}/api/v1"
        with httpx.Client(base_url=api, trust_env=False, timeout=60) as nobody:
            until_ready(nobody, workbench, tmp_path / "workbench.log")
            assert nobody.get("/sessions").status_code == 401
        assert run("workbench", health).wait(timeout=60) == 0
        with httpx.Client(
            base_url=api, trust_env=False, timeout=60, headers={"Authorization": f"Bearer {token}"}
        ) as client:
            session = simulated_session(client, captures=14)
            job = wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
            assert job["status"] == "done", job
            assert client.get(f"/sessions/{session}/results/tcp").json()["provenance"] == "solved"

            workbench.send_signal(signal.SIGTERM)  # the container is made anew; volumes stay
            assert workbench.wait(timeout=grace_s) == 0
            until_ready(client, run("workbench", words_of("workbench")), tmp_path / "workbench.log")
            assert client.get(f"/sessions/{session}/results/tcp").json()["provenance"] == "solved"
            assert client.get(f"/sessions/{session}/answer").json()["faults"] == []
