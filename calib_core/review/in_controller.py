"""What stands in a controller, compared with the frames of an answer."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from calib_core.exports.answer import Answer
from calib_core.exports.axis_frames import other_axes
from calib_core.messages import message
from calib_core.robots.read_back import ReadBack, frame_in, read_back, typed_numbers


def compared_with(
    answer: Answer,
    *,
    numbers: str | Sequence[float] | None = None,
    convention: str | None = None,
    files: Mapping[str, bytes] | None = None,
    brand: str | None = None,
    named: str | None = None,
) -> ReadBack:
    """Compare numbers, or the frame of that name in a controller's files, with the answer: equal, or what differs.

    Of several scanners, and of axes whose frame is named, it is the one that is nearest, and the words say which.

    Raises
    ------
    InputError
        If the numbers are no pose, or the file holds no such frame.
    """
    scanners = {f"{one.into}_from_laser:{name}": one for name, (one, _) in answer.scanners().items()}
    scanners = scanners or {"": answer.mount_from_laser}
    into = {one.into for one in scanners.values()}
    tables = {f"base_from_{one.name}": one.frame for one in other_axes(answer)}
    if answer.base_from_turntable is not None:
        tables["base_from_turntable"] = answer.base_from_turntable
    expected = {**scanners, **tables}
    if files:
        convention, values, on = frame_in(files, brand, named, into | ({"base"} if tables and named else set()))
        expected = {name: one for name, one in expected.items() if one.into == on}
    else:
        convention = convention or answer.session.cell.pose_convention
        values = typed_numbers(numbers, convention) if isinstance(numbers, str) else numbers or ()
        expected = scanners
    each = {name: read_back(values, convention, one) for name, one in expected.items()}
    nearest = min(each, key=lambda name: (not each[name].equal, each[name].position_mm))
    found = each[nearest]
    if nearest:
        found = replace(found, words=message("{frame}: {words}", frame=nearest, words=found.words))
    return found.of_answer(answer.faults)
