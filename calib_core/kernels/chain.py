"""Hot loops of the chain: what points know of a sphere's centre and the scanner, and of alike pose errors."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.matrices import cholesky_3, invert_lower_3, invert_positive_3

IntArray = NDArray[np.int64]

FLATTEST = 0.05
"""A ray that only grazes the sphere, |u_z| below this, says nothing reliable of its density."""


@njit(cache=True, nogil=True, error_model="numpy")
def sphere_information(
    points: FloatArray,
    shifts: FloatArray,
    counts: FloatArray,
    first: int,
    last: int,
    weight: float,
    effective: float,
    ray: FloatArray,
    center: FloatArray,
    radius: float,
    gradient: FloatArray,
    information: FloatArray,
) -> float:
    """Return half the weighted squared distances |p − q| − R − shift of points, and their density's other part.

    A scanner's noise acts along its ray, z, while residuals are distances to the sphere: the density of a measured
    z has the slope between the two, |u · ray| with u the unit normal, as a factor.  Over a profile that is r/R
    times what does not change.  It hardly matters to a capture, but all captures' add up in radius and scales.

    Parameters
    ----------
    points, shifts, counts : (M, 3), (M,), (M,)
        In L, mm; how far each is taken to lie outside the sphere, mm; how many measured points it stands for.
        Those from `first` to `last` (excluded) count.
    weight, effective : float
        1/σ² of a measured point, 1/mm²; how many independent points one counts as in the density.
    ray : (2,)
        By how much, in x and z, one unit of measured z moves a point: the scanner's shear, and one plus its scale.
    center, radius : (3,), float
        The sphere in L, mm.
    gradient, information : (≥ 3,), (≥ 3, ≥ 3)
        Over the centre; Gauss–Newton.  Added to.
    """
    qx, qy, qz = center[0], center[1], center[2]
    c = gx = gy = gz = 0.0
    xx = xy = xz = yy = yz = zz = 0.0
    density = by_x = by_y = by_z = flat = 0.0
    for i in range(first, last):
        dx, dy, dz = points[i, 0] - qx, points[i, 1] - qy, points[i, 2] - qz
        distance = np.sqrt(dx * dx + dy * dy + dz * dz)
        residual = distance - radius - shifts[i]
        scale = 1.0 / distance
        many = counts[i]
        dx *= scale
        dy *= scale
        dz *= scale
        steepness = ray[0] * dx + ray[1] * dz
        if abs(steepness) > FLATTEST:
            density -= many * np.log(abs(steepness))
            by_x += many * scale * (ray[0] / steepness - dx)
            by_y -= many * scale * dy
            by_z += many * scale * (ray[1] / steepness - dz)
            flat += many * scale * scale
        c += many * residual * residual
        gx -= many * dx * residual
        gy -= many * dy * residual
        gz -= many * dz * residual
        xx += many * dx * dx
        xy += many * dx * dy
        xz += many * dx * dz
        yy += many * dy * dy
        yz += many * dy * dz
        zz += many * dz * dz
    sums = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    slopes = (gx, gy, gz)
    by_density = (by_x, by_y, by_z)
    for i in range(3):
        gradient[i] += weight * slopes[i] + effective * by_density[i]
        for j in range(3):
            information[i, j] += weight * sums[i][j]
    information[1, 1] += effective * flat  # a great circle's y: else nothing bends there
    return 0.5 * weight * c + effective * density


@njit(cache=True, nogil=True, error_model="numpy")
def settle_centers(
    points: FloatArray,
    shifts: FloatArray,
    counts: FloatArray,
    offsets: IntArray,
    weights: FloatArray,
    effective: FloatArray,
    rays: FloatArray,
    anchors: FloatArray,
    anchor_information: FloatArray,
    anchor_gradient: FloatArray,
    radii: FloatArray,
    predicted: FloatArray,
    precision: FloatArray,
    centers: FloatArray,
) -> float:
    """Move each capture's own sphere centre to where its points and its pose's error together want it.

    Minimises, capture by capture, what `sphere_information` returns (or the anchor's quadratic) plus
    ½ (q − predicted)ᵀ S⁻¹ (q − predicted), by damped Gauss–Newton: undamped it can overshoot near a great
    circle, where y is hardly known.

    Parameters
    ----------
    points, shifts, counts, offsets, weights : (M, 3), (M,), (M,), (K + 1,), (K,)
        See `sphere_information`.
    effective : (K,)
        How many independent points one of a profile counts as in the density.
    rays : (K, 2)
        Of each capture, see `sphere_information`.
    anchors, anchor_information, anchor_gradient : (K, 3), (K, 3, 3), (K, 3)
        For captures without points: where the quadratic stands, its sharpness and slope there.
    radii : (K,)
        The spheres', mm.
    predicted, precision : (K, 3), (K, 3, 3)
        Where the unknowns expect the centre, and S⁻¹.
    centers : (K, 3)
        Moved.

    Returns
    -------
    float
        The sum of the minima.
    """
    total = 0.0
    trial = np.empty(3)
    system = np.empty((3, 3))
    inverse = np.empty((3, 3))
    slope = np.empty(3)
    gradient = np.empty(3)
    information = np.empty((3, 3))
    trial_gradient = np.empty(3)
    trial_information = np.empty((3, 3))
    for k in range(len(weights)):
        cost = own_cost(
            points, shifts, counts, offsets[k], offsets[k + 1], weights[k], effective[k], rays[k], anchors[k],
            anchor_information[k], anchor_gradient[k], radii[k], predicted[k], precision[k], centers[k], gradient,
            information,
        )  # fmt: skip
        damping = 0.0
        for _ in range(40):
            decrease = 0.0
            for i in range(3):
                slope[i] = gradient[i]
                for j in range(3):
                    slope[i] += precision[k, i, j] * (centers[k, j] - predicted[k, j])
                    system[i, j] = information[i, j] + precision[k, i, j]
                system[i, i] *= 1.0 + damping
            invert_positive_3(system, inverse)
            for i in range(3):
                step = -(inverse[i, 0] * slope[0] + inverse[i, 1] * slope[1] + inverse[i, 2] * slope[2])
                trial[i] = centers[k, i] + step
                decrease -= 0.5 * step * slope[i]
            if decrease < 1e-9:
                break
            trial_cost = own_cost(
                points, shifts, counts, offsets[k], offsets[k + 1], weights[k], effective[k], rays[k], anchors[k],
                anchor_information[k], anchor_gradient[k], radii[k], predicted[k], precision[k], trial,
                trial_gradient, trial_information,
            )  # fmt: skip
            if trial_cost <= cost:
                cost = trial_cost
                for i in range(3):
                    centers[k, i], gradient[i] = trial[i], trial_gradient[i]
                    for j in range(3):
                        information[i, j] = trial_information[i, j]
                damping *= 0.1
            else:
                damping = max(10.0 * damping, 1e-3)
        total += cost
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def own_cost(
    points: FloatArray,
    shifts: FloatArray,
    counts: FloatArray,
    first: int,
    last: int,
    weight: float,
    effective: float,
    ray: FloatArray,
    anchor: FloatArray,
    anchor_information: FloatArray,
    anchor_gradient: FloatArray,
    radius: float,
    predicted: FloatArray,
    precision: FloatArray,
    center: FloatArray,
    gradient: FloatArray,
    information: FloatArray,
) -> float:
    """Return one capture's cost at a centre, its pose's error included; write the own part's derivatives."""
    cost = 0.0
    gradient[:] = 0.0
    information[:] = 0.0
    if last > first:
        cost = sphere_information(
            points, shifts, counts, first, last, weight, effective, ray, center, radius, gradient, information
        )
    else:
        for i in range(3):
            off_i = center[i] - anchor[i]
            gradient[i] = anchor_gradient[i]
            for j in range(3):
                information[i, j] = anchor_information[i, j]
                gradient[i] += anchor_information[i, j] * (center[j] - anchor[j])
            cost += 0.5 * off_i * (gradient[i] + anchor_gradient[i])
    for i in range(3):
        for j in range(3):
            cost += 0.5 * (center[i] - predicted[i]) * precision[i, j] * (center[j] - predicted[j])
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def nuisance_information(
    points: FloatArray,
    shifts: FloatArray,
    counts: FloatArray,
    measured: FloatArray,
    basis: FloatArray,
    offsets: IntArray,
    weights: FloatArray,
    effective: FloatArray,
    rays: FloatArray,
    radii: FloatArray,
    centers: FloatArray,
    gradient: FloatArray,
    information: FloatArray,
) -> None:
    """Write gradient (K, 11) and Gauss–Newton information (K, 11, 11) of profiles over centre and nuisances.

    The nuisances, in this order: radius, scale of x, scale of z, shear, bow of z, and three shapes of the error
    by the angle of incidence.

    Parameters
    ----------
    points, shifts, counts, offsets, weights, effective, rays, radii, centers
        See `settle_centers`.
    measured : (M, 3)
        The points as the scanner gave them: scales and shear act on these.
    basis : (M, 4)
        Of each point: what one unit of bow moves it along z, mm, and the three shapes.
    """
    row = np.empty(11)
    for k in range(len(weights)):
        if offsets[k + 1] == offsets[k]:
            continue
        g, h = gradient[k], information[k]
        g[:] = 0.0
        h[:] = 0.0
        ray, radius = rays[k], radii[k]
        for i in range(offsets[k], offsets[k + 1]):
            x, z = measured[i, 0], measured[i, 2]
            dx, dy, dz = points[i, 0] - centers[k, 0], points[i, 1] - centers[k, 1], points[i, 2] - centers[k, 2]
            distance = np.sqrt(dx * dx + dy * dy + dz * dz)
            residual = distance - radius - shifts[i]
            dx /= distance
            dy /= distance
            dz /= distance
            row[0], row[1], row[2], row[3] = -dx, -dy, -dz, -1.0
            row[4], row[5], row[6], row[7] = dx * x, dz * z, dx * z, dz * basis[i, 0]
            row[8], row[9], row[10] = -basis[i, 1], -basis[i, 2], -basis[i, 3]
            steepness = ray[0] * dx + ray[1] * dz
            if abs(steepness) > FLATTEST:
                independent = effective[k] * counts[i]
                by_x = -independent * (ray[0] / steepness - dx) / distance  # of the point
                by_y = independent * dy / distance
                by_z = -independent * (ray[1] / steepness - dz) / distance
                g[0] -= by_x
                g[1] -= by_y
                g[2] -= by_z
                g[4] += by_x * x
                g[5] += by_z * z - independent * dz / steepness
                g[6] += by_x * z - independent * dx / steepness
                g[7] += by_z * basis[i, 0]
                h[1, 1] += independent / (distance * distance)
            many = weights[k] * counts[i]
            for p in range(11):
                g[p] += many * row[p] * residual
                for q in range(p, 11):
                    h[p, q] += many * row[p] * row[q]
        for p in range(11):
            for q in range(p):
                h[p, q] = h[q, p]


@njit(cache=True, nogil=True, error_model="numpy")
def predict_centers(
    rotations: FloatArray,
    translations: FloatArray,
    mount_rotations: FloatArray,
    mount_translations: FloatArray,
    scanner: IntArray,
    centers: FloatArray,
    predicted: FloatArray,
    jacobian: FloatArray,
) -> None:
    """Write where each capture should see its sphere's centre in L, and the derivatives.

    q = R_sᵀ (R_0ᵀ (c − T_0) − T_s).  Columns of the derivative: rotation of the scanner's mount (on the right),
    its translation, the capture's sphere centre.

    Parameters
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        From what carries the scanner into what carries the ball.
    mount_rotations, mount_translations : (S, 3, 3), (S, 3)
        Of each scanner on what carries it.
    scanner : (K,)
        Which one each capture is of.
    centers : (K, 3)
        Each capture's sphere centre in what carries it, mm.
    predicted, jacobian : (K, 3), (K, 3, 9)
        Written.
    """
    for k in range(len(translations)):
        b, r, t = rotations[k], mount_rotations[scanner[k]], mount_translations[scanner[k]]
        dx = centers[k, 0] - translations[k, 0]
        dy = centers[k, 1] - translations[k, 1]
        dz = centers[k, 2] - translations[k, 2]
        tx = b[0, 0] * dx + b[1, 0] * dy + b[2, 0] * dz - t[0]
        ty = b[0, 1] * dx + b[1, 1] * dy + b[2, 1] * dz - t[1]
        tz = b[0, 2] * dx + b[1, 2] * dy + b[2, 2] * dz - t[2]
        j = jacobian[k]
        for i in range(3):
            predicted[k, i] = r[0, i] * tx + r[1, i] * ty + r[2, i] * tz
            for m in range(3):
                j[i, 3 + m] = -r[m, i]
                j[i, 6 + m] = r[0, i] * b[m, 0] + r[1, i] * b[m, 1] + r[2, i] * b[m, 2]
        qx, qy, qz = predicted[k, 0], predicted[k, 1], predicted[k, 2]
        j[0, 0] = j[1, 1] = j[2, 2] = 0.0
        j[0, 1], j[0, 2] = -qz, qy
        j[1, 0], j[1, 2] = qz, -qx
        j[2, 0], j[2, 1] = -qy, qx


@njit(cache=True, nogil=True, error_model="numpy")
def pose_error_gain(information: FloatArray, spread: FloatArray, gain: FloatArray, share: FloatArray) -> float:
    """Write G = S (I + A S)⁻¹ and N = (I + S A)⁻¹ for each capture's 3×3 blocks; return Σ log det(I + A S).

    A is what a capture knows of the sphere's centre in L and S the covariance of that centre by the pose's own
    error; then A N = A − A G A is what is left when the pose error is integrated out (Woodbury).  A great circle
    makes A nearly singular while its other directions are known to micrometres, so both come from the Cholesky
    factor of S, L, and that of I + Lᵀ A L, which nothing cancels in.

    Parameters
    ----------
    information : (K, m ≥ 3, m)
        Its upper left 3×3 blocks are used.
    spread, gain, share : (K, 3, 3)
        S; G and N to be written.
    """
    logarithm = 0.0
    b = np.empty((3, 3))
    m = np.empty((3, 3))
    low = np.zeros((3, 3))
    low_inverse = np.zeros((3, 3))
    for k in range(len(spread)):
        a, s = information[k], spread[k]
        cholesky_3(s, low)
        invert_lower_3(low, low_inverse)
        for i in range(3):
            for j in range(3):
                value = 0.0
                for p in range(3):
                    for q in range(3):
                        value += low[p, i] * a[p, q] * low[q, j]
                b[i, j] = value
            b[i, i] += 1.0
        logarithm += invert_positive_3(b, m)
        for i in range(3):
            for j in range(3):
                of_gain = of_share = 0.0
                for p in range(i + 1):
                    for q in range(3):
                        of_gain += low[i, p] * m[p, q] * low[j, q]
                        of_share += low[i, p] * m[p, q] * low_inverse[q, j]
                gain[k, i, j] = of_gain
                share[k, i, j] = of_share
    return logarithm
