"""The turntable with the tool held: where that puts the unknowns, and how the tool's uncertainty enters theirs."""

from dataclasses import replace

import numpy as np

from calib_core.chain.held import hold_files
from calib_core.chain.likelihood import fit, linearised_at
from calib_core.chain.model import ChainState
from calib_core.chain.rejection import Judged
from calib_core.chain.table_given import KnownTool
from calib_core.chain.table_tool import ToolMove
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray


def with_tool_held(judged: Judged, tool: KnownTool, move: ToolMove | None) -> tuple[ChainState, FloatArray]:
    """Return the unknowns with tool and scanner held, and their covariance with those' carried over.

    About the minimum the table follows tool and scanner by −H⁻¹ H_tool, with H of the other unknowns.
    """
    fitted, mounts = judged.fit, judged.data.walk.layout.of_mounts
    if tool.sought:
        sought = hold_files(judged, False)
        return sought.state, sought.covariance
    if tool.held is None:
        return fitted.state, _without(mounts[judged.data.held[mounts]], fitted.covariance * judged.inflation)
    known, data = tool.held, judged.data
    nothing = np.zeros(len(data.kinds))
    exact = replace(data.holding(mounts), tool_prior=None, nuisance_sigmas=nothing)
    answer = known.state.position
    begin = replace(
        fitted.state.with_mounts_of(answer.mount_rotations, answer.mount_translations),
        scanner=np.where(data.of_files, 0.0, known.state.scanner),
    )
    found = fit(exact, begin, fitted.sigmas)
    width = data.unknowns
    inverse = covariance_of(found.at.hessian)
    as_if_known = covariance_of(fitted.minimum.at.hessian)
    # By how much estimated sigmas enlarged the covariance of the fit with the tool free, so they do here.
    free = np.setdiff1d(np.arange(width), mounts)
    grown = np.sqrt(np.maximum(np.diag(fitted.covariance)[free] / np.diag(as_if_known)[free], 1.0))
    own = inverse[:width, :width].copy()
    own[np.ix_(free, free)] *= np.outer(grown, grown) * judged.inflation
    sigmas = nothing.copy()
    sigmas[known.active] = 1.0
    every = np.zeros(width, dtype=bool)
    whole = linearised_at(
        replace(data, held=every, tool_prior=None, nuisance_sigmas=sigmas), found.state, fitted.sigmas
    )
    # Errors that poses share are eliminated with the table's unknowns: they follow too.
    count, size = len(known.active), len(whole.hessian)
    by = np.concatenate([mounts, np.arange(width, width + count)])
    rest = np.setdiff1d(np.arange(size), by)
    rest = rest[~np.isin(rest, np.flatnonzero(exact.held))]
    follows = np.zeros((size, len(by)))
    follows[rest] = -covariance_of(whole.hessian[np.ix_(rest, rest)]) @ whole.hessian[np.ix_(rest, by)]
    follows = follows[:width]
    follows[mounts, : len(mounts)] = np.eye(len(mounts))
    some = known.mounts_and_scanners
    carried = known.covariance[np.ix_(some, some)]
    if move is not None:
        carried = carried + move.share * np.outer(move.off, move.off)
    return found.state, _without(mounts, own) + follows @ carried @ follows.T


def _without(exact: np.ndarray, covariance: FloatArray) -> FloatArray:
    """Return a covariance (P, P) in which some unknowns are exact."""
    covariance = covariance.copy()
    covariance[exact], covariance[:, exact] = 0.0, 0.0
    return covariance
