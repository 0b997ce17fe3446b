"""What speaks against the captures of a verification themselves, before any figure is judged by them."""

from typing import Final

import numpy as np

from calib_core.chain.observations import Observations
from calib_core.findings.codes import verify as codes
from calib_core.records.findings import Finding
from calib_core.stages.verify.held_out import HeldOut

_OFF_MM: Final = 1.0  # arms that err by half a millimetre leave less, and their scatter is in the uncertainty
_OFF_SHARE: Final = 0.04  # of the ball's radius
_MANY: Final = 0.25  # of the captures: of fewer the others tell that they are wrong


def contradictions(observations: Observations, radius_mm: float, found: HeldOut) -> list[Finding]:
    """Return that many captures' points lie off the ball whatever the tool is, or that their sides stay open."""
    off = found.asked.surface_rms_mm(observations, radius_mm)
    far = np.flatnonzero(off > max(_OFF_MM, _OFF_SHARE * radius_mm))
    if len(far) > _MANY * len(off):
        names = [observations[k].capture for k in far.tolist()]
        return [codes.POINTS_OFF_BALL(list(dict.fromkeys(names)), off_mm=float(np.nanmax(off)))]
    return [codes.VERIFY_SIDES_OPEN()] if found.sides_open else []
