"""Both kinds of store for the tests: SQLite with a folder, and a real PostgreSQL with an S3 bucket."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from server.settings import Settings
from server.store.blob_folder import FolderBlobs
from server.store.database import Store
from server.store.models import EventRow
from tests.server.postgres import new_database, running_postgres
from tests.server.s3 import running_s3, s3_client

PLACES = ("sqlite and folder", "postgresql and s3")
NewPlace = Callable[[Path], dict[str, Any]]


@pytest.fixture(scope="session", params=PLACES)
def new_place(request: pytest.FixtureRequest) -> Iterator[NewPlace]:
    """Return settings of a fresh store of one kind, each time it is called."""
    if request.param == PLACES[0]:
        yield lambda data: {"data": data}
        return
    count = 0
    with running_postgres() as postgres, running_s3() as s3:

        def made(data: Path) -> dict[str, Any]:
            nonlocal count
            count += 1
            s3_client(s3).create_bucket(Bucket=f"scancell-{count}")
            address = new_database(postgres, f"store{count}")
            return {
                "data": data,
                "database_url": address,
                "blobs": f"s3://scancell-{count}/blobs",
                "s3_endpoint": s3,
            }

        yield made


@pytest.fixture
def settings(new_place: NewPlace, tmp_path: Path) -> Settings:
    return Settings(**new_place(tmp_path / "data"), port=0, warm_up=False)


@pytest.fixture
def published() -> list[EventRow]:
    return []


@pytest.fixture
def store(settings: Settings, published: list[EventRow]) -> Iterator[Store]:
    store = Store(settings, published.append)
    store.migrate()
    yield store
    store.close()


def alter(settings: Settings, digest: str, content: bytes | None) -> None:
    """Damage a blob behind the store's back, or remove it."""
    if settings.blobs is None:
        path = FolderBlobs(settings.data / "blobs").path(digest)
        if content is None:
            path.unlink()
        else:
            path.write_bytes(content)
        return
    client = s3_client(str(settings.s3_endpoint))
    bucket, _, prefix = settings.blobs.removeprefix("s3://").partition("/")
    key = f"{prefix}/{digest[:2]}/{digest}"
    if content is None:
        client.delete_object(Bucket=bucket, Key=key)
    else:
        client.put_object(Bucket=bucket, Key=key, Body=content)
