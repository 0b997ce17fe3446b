"""Machines' own files: what stands in a controller's or a scanner's."""

from typing import Annotated, Any, Literal

from fastapi import File, Form, Response, UploadFile
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.concurrency import run_in_threadpool

from calib_core.captures.certificate import Certificate
from calib_core.poses.numbers import convention_named
from calib_core.proof import Proof
from calib_core.recognition.taken import TakenFor
from calib_core.records import ArmTable
from calib_core.records.field_errors import input_error
from calib_core.robots.file_hints import Told
from server.http.api_router import api_router
from server.http.strict_json import parse_object, plain_json
from server.routes.dependencies import IdempotencyDep, UploadMemoryDep
from server.routes.machine_files import Files, Word, contents_of, size_of

router = api_router("machines")


class PoseOfFile(BaseModel):
    """A pose of the flange in the base, as far as the file tells it; `matrix` is the same in mm."""

    name: str
    pose: list[float] | None
    matrix: list[list[float]] | None
    convention: str
    joints_deg: list[float] | None
    external: dict[str, float] | None
    tool: int | str | None
    frame: int | str | None
    line: int
    file: str | None
    as_written: list[float] | None
    doubt: str | None
    time_s: float | None


class FrameOfFile(BaseModel):
    """A tool in the flange, or a user frame in the base."""

    number: int | None
    name: str | None
    pose: list[float]
    convention: str
    line: int
    file: str | None
    moving: str | None


class SkippedPart(BaseModel):
    """What was not taken, and why."""

    line: int
    reason: str
    file: str | None


class ControllerFileContent(BaseModel):
    """What stands in a controller's files."""

    brand: str
    files: list[str] = Field(description="Those of them that are of this brand and were read.")
    poses: list[PoseOfFile]
    tools: list[FrameOfFile]
    frames: list[FrameOfFile]
    skipped: list[SkippedPart]
    notes: list[str]
    proof: Proof = Field(description="What proved their reader.")


class Brand(BaseModel):
    """A robot brand, or another kind of file with poses."""

    name: str
    title: str
    conventions: list[str]
    endings: list[str]
    reads: bool
    exports: list[str]
    proof: Proof = Field(description="What proved its reader, and its writer by the same syntax.")
    experimental: bool


class Brands(BaseModel):
    """Whose files are known."""

    items: list[Brand]


class FileReading(BaseModel):
    """What a reader takes from a scanner's file, before it is used."""

    format: str
    kind: Literal["profile", "cloud"]
    points: int
    missing: int
    grid: list[int] | None
    columns: dict[str, str]
    unit: str
    unit_from: str
    sure: Literal["stated", "usual", "doubtful"]
    notes: list[str]
    doubts: list[str]
    sentence: str
    low_mm: list[float] | None
    high_mm: list[float] | None
    preview: list[list[float]] = Field(description="Some of the points, for a drawing.")
    settings: dict[str, Any] = Field(description="The JSON Schema of what may be said about such a file.")


class _Known(BaseModel):
    """What is known about files that are to be recognised."""

    model_config = ConfigDict(extra="forbid")
    taken_for: dict[str, TakenFor] = Field(default_factory=dict)
    convention: str | None = None
    sphere_diameter_mm: float | None = Field(default=None, gt=0, lt=1e5)
    sizes: dict[str, int] = Field(default_factory=dict)


class ReasonGiven(BaseModel):
    """Why: a code, its values, and both as an English sentence."""

    reason: str
    values: dict[str, str | int | float]
    why: str


class RecognisedFile(ReasonGiven):
    """What a file is taken for, and why."""

    name: str
    taken_for: TakenFor
    preview: list[list[float]] = Field(description="Some of its points, x and z, for a small picture.")


class RecognisedPose(BaseModel):
    """A pose as a file has it, in the convention that was chosen."""

    name: str
    pose: list[float]
    file: str
    line: int
    time_s: float | None
    joints_deg: list[float] | None
    table_deg: float | None
    doubt: str | None


class FilePair(BaseModel):
    """A measurement and its pose, by their places in `files` and `poses`; null where one of them lacks."""

    file: int | None
    pose: int | None


class ChosenConvention(BaseModel):
    """The convention of the poses, and whether it is sure."""

    name: str
    sure: bool
    why: str


class RecognisedFiles(BaseModel):
    """What files are, together: as many are listed as came."""

    files: list[RecognisedFile]
    poses: list[RecognisedPose]
    pairs: list[FilePair] = Field(description="Measurements in their order, then poses without one.")
    paired_by: Literal["name", "number", "time", "order"] | None
    convention: ChosenConvention | None
    sphere_diameter_mm: float | None
    sphere_from: str | None
    doubts: list[ReasonGiven]
    missing: list[ReasonGiven]


@router.get("/brands", response_model=Brands)
def brands() -> Brands:
    """List the robot brands and other kinds of files that poses are read from."""
    from calib_core.robots.registry import BRANDS

    return Brands(items=[Brand.model_validate(brand.describe()) for brand in BRANDS])


class CertificateText(BaseModel):
    """A digital calibration certificate (DCC) as it came; `of_sphere` refuses one without a diameter."""

    model_config = ConfigDict(extra="forbid")
    xml: str = Field(max_length=3_000_000, examples=["<dcc:digitalCalibrationCertificate …"])
    of_sphere: bool = True


@router.post("/certificates", response_model=Certificate)
def read_sphere_certificate(body: CertificateText, _: IdempotencyDep) -> Certificate:
    """Return the diameters of a sphere's digital certificate, with their standard uncertainty; stores nothing."""
    from calib_core.captures.certificate import read_certificate

    return read_certificate(body.xml.encode(), of_sphere=body.of_sphere)


class Arms(BaseModel):
    """The arms that are known by name, as `cell.robot.arm` names them."""

    items: list[str]


@router.get("/arms", response_model=Arms)
def arms() -> Arms:
    """List the arms that are known by name."""
    from calib_core.arms.kinematics import NAMED_ARMS

    return Arms(items=list(NAMED_ARMS))


class ArmText(BaseModel):
    """An arm's URDF as it came, and the links between which the arm is, where these are not base and tool0."""

    model_config = ConfigDict(extra="forbid")
    xml: str = Field(max_length=5_000_000, examples=["<robot name='…'>"])
    name: str = Field(default="URDF", max_length=200)
    base: str | None = Field(default=None, max_length=200)
    tip: str | None = Field(default=None, max_length=200)


@router.post("/arms", response_model=ArmTable)
def read_arm(body: ArmText, _: IdempotencyDep) -> Response:
    """Return an arm's joints as `cell.robot.arm` has them, from its URDF; stores nothing."""
    from calib_core.arms.urdf import arm_from_urdf

    return JSONResponse(arm_from_urdf(body.xml.encode(), body.name, body.base, body.tip).to_json())


@router.post("/controller-files", response_model=ControllerFileContent)
async def read_controller(
    files: Files,
    _: IdempotencyDep,
    memory: UploadMemoryDep,
    brand: Word = "",
    as_written: Annotated[bool, Form(description="Take poses whose tool or frame is unknown.")] = False,
    told: Annotated[
        str, Form(max_length=5000, description="What the files do not say, as JSON.", examples=['{"unit": "mm"}'])
    ] = "{}",
) -> Response:
    """Return poses, tools and frames of a controller's files, before they are used; stores nothing."""
    async with memory.taken(size_of(files)):
        contents = await contents_of(files)
        said = Told.of({str(name): str(value) for name, value in parse_object(told, "told").items()})
        found = await run_in_threadpool(_read_controller, contents, brand or None, as_written, said)
    return JSONResponse(plain_json(found))


@router.post("/recognised-files", response_model=RecognisedFiles)
async def recognise_files(
    files: Files,
    _: IdempotencyDep,
    memory: UploadMemoryDep,
    told: Annotated[
        str,
        Form(
            max_length=1_000_000,
            description="As JSON: `taken_for` by file name, `convention`, `sphere_diameter_mm`, and `sizes` of "
            "files of which only the beginning is sent (64 kB tell what a file is).",
            examples=['{"taken_for": {"notes.txt": "nothing"}, "convention": "kuka"}'],
        ),
    ] = "{}",
) -> Response:
    """Return what each file is taken for and why, and measurements paired with their poses; stores nothing."""
    async with memory.taken(size_of(files)):
        contents = await contents_of(files)
        known = parse_object(told, "told")
        found = await run_in_threadpool(_recognise, contents, known)
    return JSONResponse(plain_json(found))


@router.post("/readings", response_model=FileReading)
async def read_scanner_file(
    file: Annotated[UploadFile, File(description="A profile or a cloud, as it came.", examples=["x,z"])],
    _: IdempotencyDep,
    memory: UploadMemoryDep,
    kind: Annotated[Literal["profile", "cloud"] | None, Form(description="What is needed.")] = None,
    format: Word = "",  # noqa: A002 — as a capture's record calls it
    settings: Annotated[
        str,
        Form(max_length=5000, description="A capture's `format_settings`, as JSON.", examples=['{"unit": "mm"}']),
    ] = "{}",
) -> Response:
    """Return what a reader takes from a file: columns, unit, points, and how sure it is; stores nothing."""
    async with memory.taken(file.size or 0):
        data, name = await file.read(), file.filename or "file"
        told = parse_object(settings, "settings")
        reading = await run_in_threadpool(_read_points, data, name, kind, format or None, told)
    return JSONResponse(plain_json(reading))


def _read_controller(
    contents: dict[str, bytes], brand: str | None, as_written: bool, told: Told
) -> dict[str, Any]:
    from calib_core.poses.numbers import parse_pose
    from calib_core.robots.backup import read_controller_files

    found = read_controller_files(contents, brand, as_written, told).to_json()
    for pose in found["poses"]:
        numbers = pose["pose"]
        pose["matrix"] = None if numbers is None else parse_pose(pose["convention"], numbers).to_rows()
    return found


def _recognise(contents: dict[str, bytes], told: dict[str, Any]) -> dict[str, Any]:
    from calib_core.recognition.recognised import recognise
    from calib_core.recognition.taken import GivenFile

    try:
        known = _Known.model_validate(told)
    except ValidationError as error:
        raise input_error(error, told, "told") from None
    files = [GivenFile(name, data, known.sizes.get(name)) for name, data in contents.items()]
    if known.convention is not None:
        convention_named(known.convention)
    return recognise(files, known.taken_for, known.convention, known.sphere_diameter_mm).to_json()


def _read_points(
    data: bytes, name: str, kind: Literal["profile", "cloud"] | None, format_name: str | None, told: dict[str, Any]
) -> dict[str, Any]:
    from calib_core.formats.points import FORMATS, read_file

    reading = read_file(data, name, kind, format_name, told)
    return reading.to_json() | {"settings": FORMATS.get(reading.format).settings.model_json_schema()}
