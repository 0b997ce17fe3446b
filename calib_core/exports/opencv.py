"""OpenCV: matrices in the YAML that its FileStorage reads; mm."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.neutral import FrameSettings, edges
from calib_core.exports.writing import provenance
from calib_core.frames import FloatArray


def _matrix(name: str, values: FloatArray) -> list[str]:
    rows, columns = values.shape
    data = ", ".join(repr(float(v)) for v in values.ravel())
    head = [f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d"]
    return [*head, f"   data: [ {data} ]"]


def _write(answer: Answer, settings: FrameSettings) -> str:
    lines = ["%YAML:1.0", "---", *(f"# {line}" for line in provenance(answer))]
    for parent, child, frame in edges(answer, settings):
        lines += _matrix(f"{parent}_from_{child}", frame.matrix)
    lines += _matrix("covariance_rx_ry_rz_tx_ty_tz", answer.tool_covariance)
    return "\n".join(lines) + "\n"


EXPORT = Export(
    "opencv",
    "OpenCV: matrices as YAML (mm)",
    "application/yaml",
    ".yaml",
    _write,
    FrameSettings,
    proof="real files",
    open_too=True,
)
