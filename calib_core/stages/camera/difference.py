"""How far two cameras lie apart over the image."""

from collections.abc import Mapping
from typing import Any

from calib_core.captures.solved_optics import camera_from_result
from calib_core.evidence.numbers import number_text
from calib_core.messages import message
from calib_core.optics.projection_map import projection_difference
from calib_core.records.camera_result import CameraResult
from calib_core.records.evidence import Plot
from calib_core.stages.camera.evidence import grid_rows, image_map


def difference(left: Mapping[str, Any], right: Mapping[str, Any]) -> list[Plot]:
    """Return the difference of two results, given as JSON data, as a map; none for images of two sizes."""
    cameras = [camera_from_result(CameraResult.model_validate(one)) for one in (left, right)]
    if cameras[0].image_size != cameras[1].image_size:
        return []
    rows = grid_rows(projection_difference(*cameras))
    known = [one for row in rows for one in row if one is not None]
    caption = message(
        "How far a ray ends from its pixel by the other camera, at places all over the image, up to {most} px. "
        "The turn between the two is taken off. Compare it with the uncertainty that both results state there.",
        most=number_text(max(known, default=None), 3),
    )
    return [image_map(rows, "difference", title="Difference of the two cameras", caption=caption)] if known else []
