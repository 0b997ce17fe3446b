"""A file that its reader is not sure of is told before it is used: as it arrives, and by a session's check."""

import pytest

from calib_core.captures.measure import measure_capture
from calib_core.review.check import check_session
from calib_core.simulation import simulate

MADE = simulate("turntable", 3)


def in_metres(name: str) -> bytes:
    """A profile as it stands in the folder, its numbers in metres and no unit said."""
    head, *rows = MADE.files[name].decode().splitlines()
    scaled = [",".join(v and repr(float(v) / 1000) for v in row.split(",")) for row in rows]
    plain = ",".join(word.split("_")[0].split("[")[0].strip() for word in head.split(","))
    return "\n".join([plain, *scaled, ""]).encode()


@pytest.mark.parametrize("step", ["tcp", "turntable"])
def test_a_doubtful_file_is_told_as_it_arrives_and_by_the_check(step: str) -> None:
    capture = next(c for c in MADE.session.captures if c.step == step)
    name = capture.files[0]
    assert measure_capture(MADE.session, capture, MADE.files.__getitem__).verdict == "pass"
    measured = measure_capture(MADE.session, capture, in_metres)
    assert measured.verdict != "pass"
    assert measured.reason is not None
    assert "The file is doubtful: All points lie within" in measured.reason
    found = check_session(MADE.session, lambda file: in_metres(file) if file == name else MADE.files[file])
    told = [finding for finding in found if finding.code == "file-doubtful" and "Taken:" in finding.text]
    assert [(finding.captures, finding.severity) for finding in told] == [([capture.id], "warning")]
    said = capture.model_copy(update={"format_settings": {"unit": "m"}})
    measured = measure_capture(MADE.session, said, in_metres)
    assert (measured.verdict, measured.center_mm) == (
        "pass",
        pytest.approx(measure_capture(MADE.session, capture, MADE.files.__getitem__).center_mm, abs=1e-3),
    )
