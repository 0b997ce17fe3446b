"""The server's settings: arguments, or environment variables that begin with ``SCANCELL_``."""

from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from calib_core.errors import InputError
from calib_core.records import input_error

MEBIBYTE = 1024 * 1024


def is_loopback(host: str) -> bool:
    """Return whether an address can be reached from this machine alone."""
    if host == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def address_of(scheme: str, host: str, port: int) -> str:
    """Return the address by which this machine reaches what is served on a host: Windows opens no 0.0.0.0."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}"


def _page() -> Path:
    """Return the folder of the page: within the package where it is installed, beside it in a checkout."""
    here = Path(__file__).resolve().parent
    return here / "web" if (here / "web").is_dir() else here.parent / "web"


@dataclass(frozen=True)
class BlobPlace:
    """Where blobs are; it goes to worker processes, which open it for themselves.

    `folder` holds the blobs, or, where `bucket` (``s3://bucket/prefix``) does, only what is on its way.
    """

    folder: Path
    bucket: str | None = None
    endpoint: str | None = None

    @property
    def observations(self) -> Path:
        """The folder of what was seen in the captures: on this machine's disk, wherever the blobs are."""
        return self.folder.parent / "observations"


class Settings(BaseSettings):
    """Everything that may differ from one installation to the next."""

    model_config = SettingsConfigDict(env_prefix="SCANCELL_", frozen=True)

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8000
    data: Path = Path("sessions")
    database_url: str | None = Field(default=None, description="Left out: SQLite in the data folder.")
    database_wait_s: Annotated[float, Field(ge=0, le=600)] = Field(
        default=10.0, description="How long to wait for another program that holds SQLite's lock."
    )
    blobs: str | None = Field(
        default=None, description="s3://bucket or s3://bucket/prefix; left out: the data folder."
    )
    s3_endpoint: str | None = Field(default=None, description="Of an S3 store that is not Amazon's.")
    web: Path = Field(default_factory=_page, description="The page's files; left out: those that came along.")

    watch_root: Path | None = Field(
        default=None, description="Sessions may watch folders below it for captures; left out: none."
    )
    watch_rest_s: Annotated[float, Field(ge=0.05, le=3600)] = Field(
        default=1.0, description="A file in a watched folder counts as whole once it has not changed for so long."
    )

    max_json_bytes: Annotated[int, Field(gt=0)] = 4 * MEBIBYTE
    max_upload_bytes: Annotated[int, Field(gt=0)] = 128 * MEBIBYTE
    max_archive_bytes: Annotated[int, Field(gt=0)] = 2048 * MEBIBYTE
    max_files_per_capture: Annotated[int, Field(gt=0)] = 5000

    measuring_processes: Annotated[int, Field(ge=1, le=64)] = 2
    measuring_timeout_s: Annotated[float, Field(gt=0)] = Field(
        default=60.0, description="A capture that takes longer to measure is kept without."
    )
    workers: Annotated[int, Field(ge=1, le=64)] = 1
    dask: str | None = Field(default=None, description="tcp://host:8786: a cluster that solves instead.")
    cluster_patience_s: Annotated[float, Field(ge=0)] = Field(
        default=60.0, description="A job that waits so long for a cluster without workers is solved here."
    )
    warm_up: bool = Field(default=True, description="Compile and import what solving needs at start-up.")
    job_timeout_s: Annotated[float, Field(gt=0)] = 3600.0

    shutdown_grace_s: Annotated[float, Field(ge=0)] = Field(
        default=10.0, description="What is under way when the server is told to stop may take this long."
    )
    log: Literal["json", "text", "auto"] = Field(default="auto", description="auto: text on a terminal.")

    allowed_hosts: list[str] = Field(default_factory=list, description="Further names this server is called by.")
    require_login: bool = Field(default=False, description="Also on loopback, as behind a proxy.")
    login_hours: Annotated[float, Field(gt=0, le=24 * 365)] = 12.0
    trusted_proxies: list[str] = Field(
        default_factory=list, description="Addresses whose X-Forwarded-For and -Proto are believed."
    )
    webhooks_to_this_machine: bool = Field(default=False, description="To its programs, not to this server.")
    tls_certificate: Path | None = Field(default=None, description="PEM; with `tls_key` it serves https.")
    tls_key: Path | None = None
    rate_per_s: Annotated[float, Field(gt=0)] = Field(
        default=200.0, description="Requests a second that a token or address may send; tenfold on this machine."
    )
    rate_burst: Annotated[float, Field(ge=1)] = 400.0
    max_connections: Annotated[int, Field(ge=2)] = Field(
        default=800, description="Open connections at once, pages and programs together."
    )
    max_connections_per_address: Annotated[int, Field(ge=1)] = Field(
        default=200, description="Those of one address that is no trusted proxy."
    )
    head_timeout_s: Annotated[float, Field(gt=0)] = 20.0
    body_timeout_s: Annotated[float, Field(gt=0)] = 30.0
    answer_timeout_s: Annotated[float, Field(gt=0)] = 300.0

    @model_validator(mode="after")
    def _require_both_of_tls(self) -> "Settings":
        for name, path in (("tls_certificate", self.tls_certificate), ("tls_key", self.tls_key)):
            if path is None and (self.tls_certificate or self.tls_key):
                to_do = "Set {name} too."
                raise InputError("tls_certificate and tls_key together", "one of them", to_do, name, name=name)
            if path is not None and not path.is_file():
                raise InputError("a PEM file", "none", "Check the path.", f"{name}: {path}")
        return self

    def __init__(self, **values: Any) -> None:
        """Take values given here, then those of the environment; raises InputError."""
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise input_error(error, values, "settings (arguments and SCANCELL_… variables)") from None

    @property
    def login_required(self) -> bool:
        """Whether a request needs a token or a login."""
        return self.require_login or not is_loopback(self.host)

    @property
    def sql_url(self) -> str:
        """The address of the database."""
        return self.database_url or f"sqlite:///{(self.data / 'scancell.db').resolve()}"

    @property
    def blob_place(self) -> BlobPlace:
        """Where the captures' files are."""
        return BlobPlace(self.data / "blobs", self.blobs, self.s3_endpoint)
