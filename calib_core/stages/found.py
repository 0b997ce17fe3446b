"""The frames that a result has found, told alike for every stage."""

from calib_core.graph.stage import Stage
from calib_core.records import Result
from calib_core.records.results import FoundFrame


def found_frames(stage: Stage, result: Result) -> list[FoundFrame]:
    """Return every transform that a stage's result holds, with its covariance."""
    found: list[FoundFrame] = []
    told = {(frame.into, frame.outof) for frame in result.frames}
    for name, covariance in stage.frames.items():
        matrix = getattr(result, name, None)
        into, _, outof = name.partition("_from_")
        if matrix is not None and (into, outof) not in told:
            rows = [row[:6] for row in (getattr(result, covariance, None) or [])[:6]]
            found.append(FoundFrame(into=into, outof=outof, matrix=matrix, covariance=rows or None))
    return [*result.frames, *found]
