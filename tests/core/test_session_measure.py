import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.captures.observe import observe_capture
from calib_core.errors import InputError, MeasurementError
from calib_core.records import parse_capture, parse_session

DIAMETER_MM = 40.0
SIGMA_MM = 0.02
POSE = [400.0, 300.0, 500.0, 1.0, 0.0, 0.0, 0.0]


def session(**scanner):
    cell = {"pose_convention": "abb", "sphere_diameter_mm": DIAMETER_MM, "scanner": scanner}
    return parse_session({"format": "scancell-session/1", "cell": cell})


def capture(kind="profile", name="p.csv", **more):
    data = {"id": "p01", "step": "tcp", "kind": kind, "files": [name], "pose": POSE}
    return parse_capture(data | more)


def profile(zone, center=(5.0, 200.0), start_mm=-40.0, stop_mm=50.0, seed=1):
    """An arc on a background 30 mm behind the sphere, seen by a stripe from `start_mm` to `stop_mm`."""
    noise = np.random.default_rng(seed)
    x = np.arange(start_mm, stop_mm, 0.1)
    r = zone * DIAMETER_MM / 2
    z = np.full_like(x, center[1] + 30.0)
    on = np.abs(x - center[0]) < r * np.sin(np.deg2rad(65))
    z[on] = center[1] - np.sqrt(r**2 - (x[on] - center[0]) ** 2)
    z += SIGMA_MM * noise.standard_normal(len(x))
    return "".join(f"{a:.3f},{b:.4f}\n" for a, b in zip(x, z, strict=True)).encode()


def measure(data, **more):
    return measure_capture(session(), capture(**more), lambda _name: data)


def test_a_good_profile_passes_and_is_where_it_is():
    measured = measure(profile(0.7))
    assert (measured.verdict, measured.reason, measured.to_do) == ("pass", None, None)
    sigma_x, sigma_z, sigma_r = np.sqrt(np.diag(np.array(measured.covariance)))
    assert abs(measured.center_mm[0] - 5.0) < 4 * sigma_x
    assert abs(measured.center_mm[1] - 200.0) < 4 * sigma_z
    assert abs(measured.radius_mm - 14.0) < 4 * sigma_r
    assert measured.rms_mm == pytest.approx(SIGMA_MM, rel=0.2)  # 250 points: 4.5 % at one sigma
    assert measured.zone == pytest.approx(0.7, abs=0.005)
    assert measured.points == 900
    assert 0 < measured.on_sphere < 300
    assert len(measured.preview) == len(measured.preview_on_sphere) == 400
    on = np.array(measured.preview)[np.array(measured.preview_on_sphere)]
    distances = np.hypot(*(on - measured.center_mm).T)
    np.testing.assert_allclose(distances, measured.radius_mm, atol=6 * SIGMA_MM)


@pytest.mark.parametrize(
    ("zone", "said", "step_mm"),
    [
        (0.995, "almost through the sphere's middle", 20 * (np.sqrt(1 - 0.75**2) - np.sqrt(1 - 0.995**2))),
        (0.3, "only grazes", 20 * (np.sqrt(1 - 0.3**2) - np.sqrt(1 - 0.75**2))),
    ],
)
def test_a_stripe_at_the_wrong_place_says_how_far_to_move(zone, said, step_mm):
    measured = measure(profile(zone))
    assert measured.verdict == "warn"
    assert said in measured.reason
    moved_mm = float(measured.to_do.split("about ")[1].split(" mm")[0])
    assert moved_mm == pytest.approx(step_mm, abs=1.0)


@pytest.mark.parametrize(("start_mm", "stop_mm", "to"), [(4.0, 50.0, "−x"), (-40.0, 6.0, "+x")])
def test_a_sphere_that_leaves_the_stripe_says_where(start_mm, stop_mm, to):
    measured = measure(profile(0.7, start_mm=start_mm, stop_mm=stop_mm))
    assert measured.verdict == "warn"
    assert "of the arc are seen" in measured.reason
    assert measured.to_do.endswith(f"to {to}.")


def test_no_arc_fails_with_a_reason_and_keeps_the_picture():
    flat = "".join(f"{x / 10},{200 + (x % 7) / 500}\n" for x in range(-300, 300)).encode()
    measured = measure(flat)
    assert measured.verdict == "fail"
    assert "arc" in measured.reason
    assert measured.to_do
    assert len(measured.preview) == len(measured.preview_on_sphere) == 400
    assert not any(measured.preview_on_sphere)


def test_a_file_of_no_use_is_an_error_that_names_it():
    with pytest.raises(InputError, match=r"p\.csv: need a profile with points, got an empty file"):
        measure(b"")


def test_a_pose_of_no_use_is_an_error_that_names_the_capture():
    with pytest.raises(InputError, match="p01: need a pose of 7 numbers"):
        measure(profile(0.7), pose=[1.0, 2.0])
    with pytest.raises(InputError, match="p01: need the robot's pose"):
        measure(profile(0.7), pose=None)


def test_two_files_in_a_profile_capture():
    with pytest.raises(InputError, match="need one file in a profile capture, got 2 files"):
        measure(profile(0.7), files=["a.csv", "b.csv"])


def test_an_empty_frame_is_refused():
    with pytest.raises(InputError, match=r"f\.png: need an image, got an empty file"):
        measure(b"", kind="frame", name="f.png")


def cloud(seed=2):
    noise = np.random.default_rng(seed)
    direction = noise.standard_normal((3000, 3))
    direction[:, 2] = -np.abs(direction[:, 2])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radii = DIAMETER_MM / 2 + SIGMA_MM * noise.standard_normal((3000, 1))
    points = np.array([1.0, -2.0, 150.0]) + radii * direction
    return "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points).encode()


def test_a_cloud_is_measured_and_observed():
    data = cloud()
    measured = measure(data, kind="cloud", name="c.xyz")
    assert measured.verdict == "pass"
    np.testing.assert_allclose(measured.center_mm, [1, -2, 150], atol=5 * SIGMA_MM / np.sqrt(3000 / 6))
    observation = observe_capture(session(), capture("cloud", "c.xyz"), lambda _name: data)
    assert observation.points_in_laser_mm.shape == (measured.on_sphere, 3)
    np.testing.assert_array_equal(observation.center_in_laser_mm, measured.center_mm)
    assert observation.circle_radius_mm is None


def test_a_profile_is_observed_in_the_plane_of_light():
    data = profile(0.7)
    observation = observe_capture(session(), capture(side=-1), lambda _name: data)
    assert observation.kind == "profile"
    assert observation.side == -1
    assert not observation.points_in_laser_mm[:, 1].any()
    assert observation.center_in_laser_mm[1] == 0
    np.testing.assert_array_equal(observation.base_from_tool0.translation_mm, POSE[:3])
    assert observation.point_sigma_mm == pytest.approx(SIGMA_MM, rel=0.2)


def test_a_given_point_sigma_scales_the_covariance_not_the_measured_noise():
    data = profile(0.7)
    free = observe_capture(session(), capture(), lambda _name: data)
    given = observe_capture(session(point_sigma_mm=2 * free.point_sigma_mm), capture(), lambda _name: data)
    np.testing.assert_allclose(given.center_covariance, 4 * free.center_covariance)
    assert given.point_sigma_mm == free.point_sigma_mm


def test_a_center_is_taken_as_it_is():
    center = capture("center", files=[], center_mm=[1.0, 2.0, 3.0])
    assert measure_capture(session(), center, dict.__getitem__).center_mm == [1.0, 2.0, 3.0]
    observation = observe_capture(session(point_sigma_mm=0.1), center, dict.__getitem__)
    np.testing.assert_array_equal(observation.center_in_laser_mm, [1, 2, 3])
    np.testing.assert_allclose(observation.center_covariance, 0.01 * np.eye(3))
    assert observation.points_in_laser_mm.shape == (0, 3)


def test_what_cannot_be_observed_names_its_file():
    flat = "".join(f"{x / 10},{200 + (x % 7) / 500}\n" for x in range(-300, 300)).encode()
    with pytest.raises(MeasurementError, match=r"^p\.csv: "):
        observe_capture(session(), capture(), lambda _name: flat)
