"""Every capture's points with their effective number, for all that weighs them: tool, centres, table, chain."""

from dataclasses import replace

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize, by_scanner
from calib_core.chain.scanner import bow_of, displacements, incidence_shapes
from calib_core.frames import FloatArray
from calib_core.sphere.independent import along_profiles, form_floor, in_cloud

_WIDTH_MM = 100.0  # of a bow of unit size


def with_effective_points(observations: Observations, sphere: SphereSize) -> list[SphereObservation]:
    """Return observations that say how many of their points count as one independent one.

    Profiles share one estimate, from all of them; the form of the sphere adds to it the more, the shorter an arc.
    """
    profiles = [o for o in observations if o.kind == "profile" and len(o.points_in_laser_mm)]
    arcs = [_arc(o) for o in profiles]
    radii = [o.size(sphere).radius_mm for o in profiles]
    sigmas = np.array([o.point_sigma_mm for o in profiles])
    residuals = [(a, r) for a, r, _ in arcs]
    shapes = [incidence_shapes(np.abs(z) / radius) for (_, _, z), radius in zip(arcs, radii, strict=True)]
    common = along_profiles(residuals, sigmas, shapes)
    straight: dict[str, float] = {}
    for some in by_scanner(profiles):
        own = [np.hstack([shapes[k], _by_files(profiles[k], arcs[k][0], arcs[k][2])]) for k in some]
        straight[profiles[some[0]].scanner] = along_profiles([residuals[k] for k in some], sigmas[some], own)
    lengths = {
        id(o): float(np.ptp(a)) * (o.circle_radius_mm or 0.0) for o, (a, _, _) in zip(profiles, arcs, strict=True)
    }
    found: list[SphereObservation] = []
    for o in observations:
        if id(o) in lengths:
            floor = form_floor(
                len(o.points_in_laser_mm), o.point_sigma_mm, lengths[id(o)], o.size(sphere).diameter_mm
            )
            as_in_files = common + floor
            bent = max(as_in_files / (straight[o.scanner] + floor), 1.0)
            found.append(replace(o, points_per_independent=as_in_files, bent=bent))
        elif o.kind == "cloud" and len(o.points_in_laser_mm):
            found.append(replace(o, points_per_independent=_of_cloud(o, sphere)))
        else:
            found.append(o)
    return found


def _arc(o: SphereObservation) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points' angles from the arc's middle, ascending, their residuals, and their heights dz.

    Angles and heights are those of the circle at the points' x, in which a scanner's noise does not act: a point's
    own noise in the shape of an error would be explained by it.
    """
    x, z = (o.points_in_laser_mm[:, [0, 2]] - o.center_in_laser_mm[[0, 2]]).T
    radius = o.circle_radius_mm or 1.0
    sine = np.clip(x / radius, -1.0, 1.0)
    order = np.argsort(sine, kind="stable")
    heights = radius * np.sqrt(1 - sine**2)
    return np.arcsin(sine)[order], (np.hypot(x, z) - radius)[order], heights[order]


def _by_files(o: SphereObservation, angle: FloatArray, heights: FloatArray) -> FloatArray:
    """Return how a scanner's scales, shear and bow of unit size move an arc's points along its radius, (N, 4)."""
    x, z = o.center_in_laser_mm[[0, 2]]
    radius = o.circle_radius_mm or 1.0
    points = np.column_stack([x + radius * np.sin(angle), np.zeros_like(angle), z + heights])
    normals = np.column_stack([np.sin(angle), np.zeros_like(angle), heights / radius])
    return np.einsum("ni,nij->nj", normals, displacements(points, bow_of(points, _WIDTH_MM)))


def _of_cloud(o: SphereObservation, sphere: SphereSize) -> float:
    offsets = o.points_in_laser_mm - o.center_in_laser_mm
    distances = np.linalg.norm(offsets, axis=1)
    alike = in_cloud(offsets, distances - distances.mean(), o.point_sigma_mm)
    diameter_mm = o.size(sphere).diameter_mm
    return alike + form_floor(len(offsets), o.point_sigma_mm, diameter_mm, diameter_mm)
