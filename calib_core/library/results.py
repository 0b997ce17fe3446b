"""Results by stage, which print themselves and show themselves in a notebook."""

from collections.abc import Mapping
from io import BytesIO
from typing import Any

from calib_core.frames import FloatArray
from calib_core.records import Result, ResultsData, Session


class Results(dict[str, Any]):
    """Results by stage; `files` has what a merge made, by name."""

    def __init__(self, results: Mapping[str, Any], files: Mapping[str, bytes] | None = None) -> None:
        super().__init__(results)
        self.files = files or {}

    def __str__(self) -> str:
        return "\n\n".join(str(result) for result in self.values()) or "nothing solved"

    def _repr_html_(self) -> str:
        return "".join(result._repr_html_() for result in self.values())

    @property
    def points_mm(self) -> FloatArray:
        """The merged cloud, N×3 in the frame that the merge names; raises KeyError before a merge."""
        import numpy as np

        from calib_core.archive.stored_clouds import CLOUD_FILE, StoredFile

        stored = StoredFile(BytesIO(self.files[CLOUD_FILE]), CLOUD_FILE)
        return np.concatenate(list(stored.tables()))[:, :3].astype(float)


def as_records(session: Session, stored: ResultsData) -> dict[str, Result]:
    """Return results given as JSON data as records; evidence that an older version did not write is made."""
    from calib_core.archive.stored_results import result_record
    from calib_core.stages.evidence import stored_evidence
    from calib_core.steps import stage_names

    found: dict[str, Result] = {}
    for stage, data in stored.items():
        if stage in stage_names():
            record = result_record(stage).model_validate(data)
            found[stage] = record.model_copy(update={"evidence": stored_evidence(session, data)})
    return found
