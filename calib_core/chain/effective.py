"""Every capture's points with their effective number, for all that weighs them: tool, centres, table, chain."""

from dataclasses import replace

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.scanner import incidence_shapes
from calib_core.frames import FloatArray
from calib_core.sphere.independent import along_profiles, form_floor, in_cloud


def with_effective_points(observations: Observations, sphere: SphereSize) -> list[SphereObservation]:
    """Return observations that say how many of their points count as one independent one.

    Profiles share one estimate, from all of them; the form of the sphere adds to it the more, the shorter an arc.
    """
    profiles = [o for o in observations if o.kind == "profile" and len(o.points_in_laser_mm)]
    arcs = [_arc(o) for o in profiles]
    radii = [o.size(sphere).radius_mm for o in profiles]
    shapes = [incidence_shapes(np.abs(z) / radius) for (_, _, z), radius in zip(arcs, radii, strict=True)]
    sigmas = np.array([o.point_sigma_mm for o in profiles])
    common = along_profiles([(a, r) for a, r, _ in arcs], sigmas, shapes)
    lengths = {
        id(o): float(np.ptp(a)) * (o.circle_radius_mm or 0.0) for o, (a, _, _) in zip(profiles, arcs, strict=True)
    }
    found: list[SphereObservation] = []
    for o in observations:
        if id(o) in lengths:
            floor = form_floor(
                len(o.points_in_laser_mm), o.point_sigma_mm, lengths[id(o)], o.size(sphere).diameter_mm
            )
            found.append(replace(o, points_per_independent=common + floor))
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


def _of_cloud(o: SphereObservation, sphere: SphereSize) -> float:
    offsets = o.points_in_laser_mm - o.center_in_laser_mm
    distances = np.linalg.norm(offsets, axis=1)
    alike = in_cloud(offsets, distances - distances.mean(), o.point_sigma_mm)
    diameter_mm = o.size(sphere).diameter_mm
    return alike + form_floor(len(offsets), o.point_sigma_mm, diameter_mm, diameter_mm)
