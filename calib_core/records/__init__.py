"""The records of a session and its captures, and what all results share: one set for solvers, API and archive.

Names and nesting are the published session format `scancell-session/1`.  Records are frozen; what a user's file
says beyond these fields is kept and given back, so that nothing is lost in a round trip.
"""

from calib_core.records.base import (
    FORMAT,
    Finite,
    GuidedStep,
    Identifier,
    Kind,
    Matrix4,
    NotNegative,
    PoseConvention,
    Positive,
    Record,
    ResultsData,
    Rows,
    StageName,
    StepName,
    Vector3,
    Verdict,
)
from calib_core.records.callbacks import Progress, ReadFile, StoreFile
from calib_core.records.causes import (
    BeforeAfter,
    CauseKind,
    Changes,
    FlangeReading,
    PoseReading,
    RootCause,
    TableReading,
)
from calib_core.records.field_errors import input_error, input_error_from_details
from calib_core.records.findings import Finding, MessageParts, Severity
from calib_core.records.guidance import (
    BoardFacing,
    BoardsSeen,
    CheckLine,
    Guide,
    GuideLast,
    GuideNow,
    GuideStatus,
    GuideStep,
    Measured,
    Meter,
    MeterPoint,
    Still,
)
from calib_core.records.merging import MergeSettings, PartAlignment
from calib_core.records.parsing import parse_capture, parse_cell, parse_session
from calib_core.records.results import CaptureResidual, Result, Undetermined, VarianceComponents
from calib_core.records.session import (
    ArmJoint,
    ArmTable,
    Board,
    CameraSegment,
    Capture,
    Cell,
    Known,
    KnownCamera,
    KnownPlane,
    LimitChange,
    Robot,
    Session,
    TimedPose,
    Turntable,
    Verification,
)
from calib_core.records.topology import (
    CellAxis,
    FoundAxis,
    FoundSphere,
    KnownFrame,
    MountedScanner,
    Scanner,
    Sphere,
    SphereDistance,
)

__all__ = [
    "FORMAT", "ArmJoint", "ArmTable", "BeforeAfter", "Board", "BoardFacing", "BoardsSeen", "CameraSegment",
    "Capture", "CaptureResidual", "CauseKind", "Cell", "CellAxis", "Changes", "CheckLine", "Finding", "Finite",
    "FlangeReading", "FoundAxis", "FoundSphere", "Guide", "GuideLast", "GuideNow", "GuideStatus", "GuideStep",
    "GuidedStep", "Identifier", "Kind", "Known", "KnownCamera", "KnownFrame", "KnownPlane", "LimitChange",
    "Matrix4", "Measured", "MergeSettings", "MessageParts", "Meter", "MeterPoint", "MountedScanner",
    "NotNegative", "PartAlignment", "PoseConvention", "PoseReading", "Positive", "Progress", "ReadFile", "Record",
    "Result", "ResultsData", "Robot", "RootCause", "Rows", "Scanner", "Session", "Severity", "Sphere",
    "SphereDistance", "StageName", "StepName", "Still", "StoreFile", "TableReading", "TimedPose", "Turntable",
    "Undetermined", "VarianceComponents", "Vector3", "Verdict", "Verification", "input_error",
    "input_error_from_details", "parse_capture", "parse_cell", "parse_session",
]  # fmt: skip
