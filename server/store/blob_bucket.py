"""Blobs in a bucket of an S3 store."""

import tempfile
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import IO, Any, Final

from calib_core.errors import DamagedError, InputError, NotFoundError
from calib_core.messages import message
from server.store.blobs import YOUNG_S, Blobs, Pieces, copied, digest_of, missing, require_same
from server.store.unavailable import UnavailableError

_ATTEMPTS: Final = 2
_TIMEOUT_S: Final = 10


class BucketBlobs(Blobs):
    """Objects below a prefix of a bucket; the store itself makes each of them appear whole or not at all.

    Parameters
    ----------
    bucket, prefix : str
    endpoint : str or None
        The store's address; None is Amazon's own.
    folder : Path
        On the local disk, for what is on its way.

    Who may is found as every S3 client finds it: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or a profile.
    """

    def __init__(self, bucket: str, prefix: str, endpoint: str | None, folder: Path, make: bool = True) -> None:
        self._bucket = bucket
        self._prefix = f"{prefix}/" if prefix else ""
        self._folder = folder
        if make:
            self._folder.mkdir(parents=True, exist_ok=True)
        # Between finding a blob old and its removal, or its renewal: one lock for each first byte.
        self._locks = [threading.Lock() for _ in range(256)]
        self._client = _client(endpoint, _TIMEOUT_S, _ATTEMPTS)
        self._probing = _client(endpoint, timeout_s=3, attempts=1)

    def put(self, content: bytes) -> str:
        """Store bytes durably and return their SHA-256."""
        digest = sha256(content).hexdigest()
        with self._locks[int(digest[:2], 16)], _named(self._bucket):
            return digest if self._is_young(digest, YOUNG_S / 2) else self.mend(content)

    def mend(self, content: bytes) -> str:
        """Store bytes durably whatever lies in their place, and return their SHA-256."""
        digest = sha256(content).hexdigest()
        with _named(self._bucket):
            self._client.put_object(Bucket=self._bucket, Key=self._key(digest), Body=content)
        return digest

    def put_pieces(self, pieces: Pieces) -> tuple[str, int]:
        """Store bytes that come in pieces; return their SHA-256 and their number."""
        with self.scratch() as file:
            digest, size = copied(pieces, file)
            file.seek(0)
            with self._locks[int(digest[:2], 16)], _named(self._bucket):
                if not self._is_young(digest, YOUNG_S / 2):
                    self._client.upload_fileobj(file, self._bucket, self._key(digest))
        return digest, size

    def read(self, digest: str) -> bytes:
        """Return a blob's bytes, compared with their SHA-256; raises NotFoundError, DamagedError."""
        with self.open(digest) as file:
            return file.read()

    def open(self, digest: str) -> IO[bytes]:
        """Return a blob as a file to read, after it was compared; raises NotFoundError, DamagedError."""
        file = tempfile.SpooledTemporaryFile(1 << 20, dir=self._place())  # noqa: SIM115 (closed below)
        try:
            with _named(self._bucket, digest):
                self._client.download_fileobj(self._bucket, self._key(digest), file, Config=_once())
            require_same(digest, digest_of(file))
        except BaseException:
            file.close()
            raise
        return file

    def _place(self) -> str | None:
        """Return where large files pass through; the system's own place while there is no data folder."""
        return str(self._folder) if self._folder.exists() else None

    def damage(self, digest: str) -> str | None:
        """Return in words what is wrong with a blob, None where nothing is."""
        try:
            self.open(digest).close()
        except NotFoundError:
            return message("missing from the store")
        except DamagedError:
            return message("altered since it was stored")
        return None

    def digests(self, beginning: str = "") -> Iterator[str]:
        """Give the SHA-256 of every blob there is, or of those that begin with two digits."""
        with _named(self._bucket):
            pages = self._client.get_paginator("list_objects_v2").paginate(
                Bucket=self._bucket, Prefix=self._prefix + beginning
            )
            for page in pages:
                for entry in page.get("Contents", []):
                    name = entry["Key"].rsplit("/", 1)[-1]
                    if len(name) == 64:
                        yield name

    def remove(self, digests: Iterable[str], young_s: float | None = None) -> None:
        """Remove blobs that nothing refers to, except young ones."""
        for digest in digests:
            with self._locks[int(digest[:2], 16)], _named(self._bucket):
                if not self._is_young(digest, YOUNG_S if young_s is None else young_s):
                    self._client.delete_object(Bucket=self._bucket, Key=self._key(digest))

    def trouble(self) -> str | None:
        """Return in words why nothing can be stored now, None where it can; raises UnavailableError, OSError."""
        with _named(self._bucket):
            self._probing.head_bucket(Bucket=self._bucket)
        return super().trouble()

    def scratch(self) -> IO[bytes]:
        """Return a nameless file on the local disk; it goes when it is closed."""
        return tempfile.TemporaryFile(dir=self._folder)

    def interrupted(self) -> list[str]:
        """Return nothing: what an S3 store did not receive whole, it does not show."""
        return []

    def clean(self) -> None:
        """Do nothing: there is nothing to clean."""

    def _key(self, digest: str) -> str:
        return f"{self._prefix}{digest[:2]}/{digest}"

    def _is_young(self, digest: str, limit_s: float) -> bool:
        """Return whether a blob is there and will not be removed for a while."""
        from botocore.exceptions import ClientError

        try:
            stored = self._client.head_object(Bucket=self._bucket, Key=self._key(digest))
        except ClientError as error:
            if _is_absent(error):
                return False
            raise
        return (datetime.now(UTC) - stored["LastModified"]).total_seconds() < limit_s

    def require_bucket(self) -> None:
        """Refuse settings that name no bucket which answers; raises InputError."""
        from botocore.exceptions import ClientError

        try:
            with _named(self._bucket):
                self._client.head_bucket(Bucket=self._bucket)
        except (ClientError, OSError) as error:
            to_do = message(
                "Make the bucket, or name another in SCANCELL_BLOBS; check the keys and SCANCELL_S3_ENDPOINT."
            )
            raise InputError("the bucket {bucket}", str(error), to_do, "blobs", bucket=self._bucket) from None


@contextmanager
def _named(bucket: str, digest: str = "") -> Generator[None]:
    """Tell of a store that refuses or does not answer; raises UnavailableError, NotFoundError."""
    from boto3.exceptions import Boto3Error
    from botocore.exceptions import BotoCoreError, ClientError
    from s3transfer.exceptions import RetriesExceededError

    try:
        yield
    except ClientError as error:
        if not _is_absent(error):
            got = message("the S3 store refuses bucket {bucket} ({said})", bucket=bucket, said=error)
            raise UnavailableError(got) from None
        if digest:
            raise missing(digest) from None
        raise
    except (BotoCoreError, Boto3Error, RetriesExceededError) as error:
        error = getattr(error, "last_exception", error)  # what ended a fetch
        got = message("the S3 store of bucket {bucket} does not answer ({said})", bucket=bucket, said=error)
        raise UnavailableError(got) from None


@cache
def _once() -> Any:
    """Return how files are fetched: the client tries again by itself, and a store that hangs is told soon."""
    from boto3.s3.transfer import TransferConfig

    return TransferConfig(num_download_attempts=1)


def _is_absent(error: Any) -> bool:
    return error.response.get("Error", {}).get("Code") in ("404", "NoSuchKey", "NoSuchBucket", "NotFound")


@cache  # it may be used by many threads, and takes a quarter of a second to make
def _client(endpoint: str | None, timeout_s: float, attempts: int) -> Any:
    try:
        import boto3
        from botocore.config import Config
    except ImportError:
        to_do = message(
            "Install it: pip install 'scancell[{extra}]'; or leave {setting} out.",
            extra="s3",
            setting="SCANCELL_BLOBS",
        )
        raise InputError("the extra '{extra}'", "none", to_do, extra="s3") from None
    config = Config(
        connect_timeout=timeout_s,
        read_timeout=timeout_s,
        retries={"total_max_attempts": attempts, "mode": "standard"},
        max_pool_connections=32,
        # Other makers' stores need not know Amazon's newer checksums; every content is compared with its SHA-256.
        request_checksum_calculation="when_required",
        response_checksum_validation="when_required",
        s3={"addressing_style": "path" if endpoint else "auto"},
    )
    session: Any = boto3.Session()
    region = session.region_name or "us-east-1"
    return session.client("s3", endpoint_url=endpoint, region_name=region, config=config)
