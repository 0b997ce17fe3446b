"""What the routes of results give: the record of each stage, and what is known beside it."""

import operator
from collections.abc import Sequence
from functools import reduce
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, Field, create_model

from calib_core.exports.workpiece import AtWorkpiece
from calib_core.graph.registry import stages
from calib_core.records import Result
from calib_core.records.decided_before import DecidedBefore


class Stored(BaseModel):
    """What the server says of a result; `stale` where captures or cell have changed since.

    `at_workpiece` is what its uncertainty means there; `turned_deg` how far the flange was turned at each capture,
    from the first one; `decided_before`, of a verification, are decisions after which its evidence was changed.
    """

    stale: bool
    at_workpiece: list[AtWorkpiece] = Field(default_factory=list[AtWorkpiece])
    turned_deg: dict[str, float] = Field(default_factory=dict)
    decided_before: list[DecidedBefore] = Field(default_factory=list[DecidedBefore])


def _one_of(records: Sequence[type[BaseModel]]) -> Any:
    return Annotated[reduce(operator.or_, records), Field(discriminator="stage")]


_RECORDS = [stage.result for stage in stages()]
if TYPE_CHECKING:
    StageResult = StoredResult = Result
else:  # whatever the stages' registry has
    StageResult = _one_of(_RECORDS)
    StoredResult = _one_of(
        [
            create_model(
                f"Stored{record.__name__}",
                __base__=(record, Stored),
                __doc__=f"{record.__doc__} As the server keeps it.",
            )
            for record in _RECORDS
        ]
    )
