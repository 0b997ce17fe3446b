"""What all sessions of one scanner and one ball share of their errors: scale, shear, bow, the ball's size.

An answer's ± counts them, and most of it may be theirs.  From session to session they stay, so that a change can
be told that is smaller than the ±: they are one more unknown of all the sessions together, and each session's
poses say how it follows them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from calib_core.frames import FloatArray

_OF_FILES: Final = ("scale_x", "scale_z", "shear", "bow")
"""Of what is found of a scanner, what is held at zero for the tool of the files as they are."""


@dataclass(frozen=True, eq=False)
class Common:
    """A figure (n,) as it follows errors (m,) that the sessions of the same equipment share.

    Attributes
    ----------
    value : (n,)
        The figure if none of them were.
    by : (n, m)
        How the figure follows them.
    own : (n, n)
        Covariance by what is new in each session.
    belief : (m, m)
        What this session says of their size: second moments about zero.
    equipment : tuple of str
        Which scanner and ball, and the names of the errors.
    """

    value: FloatArray
    by: FloatArray
    own: FloatArray
    belief: FloatArray
    equipment: tuple[str, ...]

    def along(self, value: FloatArray, rows: FloatArray) -> "Common":
        """Return a figure that moves by `rows` (n, 6) with a scanner's pose, of which this is the change."""
        own = rows @ self.own @ rows.T
        return replace(self, value=value + rows @ self.value, by=rows @ self.by, own=own)


def common_of(answer: Mapping[str, Any], covariance: FloatArray, equipment: tuple[str, ...]) -> Common | None:
    """Return how an answer's pose of the scanner, of this covariance (6, 6), follows what was found with it.

    Its value is by how much the pose would change if nothing had been; None where nothing was sought.

    By the likelihood the pose is linear in errors that are held: its slope is covariance over covariance.
    """
    found = answer.get("scanner")
    found = (answer.get("scanner_errors") or {}).get(found) if isinstance(found, str) else found
    if not found or not found["names"]:
        return None
    names, values = list(found["names"]), np.array(found["values"], dtype=float)
    errors, with_pose = (np.array(found[k], dtype=float) for k in ("covariance", "covariance_with_tool"))
    told = np.flatnonzero(np.diag(errors) > 0)
    errors, with_pose, values = errors[np.ix_(told, told)], with_pose[:, told], values[told]
    names = [names[k] for k in told]
    try:
        slope = np.linalg.solve(errors, with_pose.T).T
        own = covariance - slope @ errors @ slope.T
        np.linalg.cholesky(own)
    except np.linalg.LinAlgError:
        return None
    off = slope @ values
    held = [] if found["applied"] else [k for k, name in enumerate(names) if name in _OF_FILES]
    if held:  # the pose is that of the files as they are: so far it has gone that way
        off = off - with_pose[:, held] @ np.linalg.solve(errors[np.ix_(held, held)], values[held])
    return Common(-off, -slope, own, errors + np.outer(values, values), (*equipment, *names))
