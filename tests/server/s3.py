"""An S3-compatible server for the tests, a process of its own on loopback."""

import os
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import httpx

from tests.server.postgres import free_port

# Before any server starts processes that read them.
os.environ |= {"AWS_ACCESS_KEY_ID": "tests", "AWS_SECRET_ACCESS_KEY": "tests", "AWS_EC2_METADATA_DISABLED": "true"}


@contextmanager
def running_s3() -> Generator[str]:
    """Run a server; gives its address."""
    port = free_port()
    address = f"http://127.0.0.1:{port}"
    process = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        end_s = time.monotonic() + 300
        while not _answers(address):
            assert process.poll() is None, "the S3 server ended at its start"
            assert time.monotonic() < end_s, "the S3 server does not start"
            time.sleep(0.05)
        yield address
    finally:
        process.kill()
        process.wait()


def s3_client(address: str) -> Any:
    import boto3

    return boto3.client("s3", endpoint_url=address, region_name="us-east-1")


def _answers(address: str) -> bool:
    try:
        return httpx.get(f"{address}/moto-api/", trust_env=False).status_code == 200
    except httpx.TransportError:
        return False
