"""Live devices: the offset between clocks, what goes wrong with a device, a camera at 60 frames a second."""

import multiprocessing
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from calib_core.clock_offset import clock_offset
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import parse_cell
from server.live.exposures import exposure_of
from server.live.link import Link
from server.live.live_captures import CaptureSettings
from server.live.live_cell import LiveCell
from server.live.pictures import preview_jpeg
from server.live.recording import Recording
from server.simulated_cell.devices import SimulatedDevices
from server.simulated_cell.gige_server import GigeServer
from server.simulated_cell.stream_server import StreamServer
from server.sources.device import Frame, Reading, Sample, host_now_s
from server.sources.lossless import lossless
from server.sources.registry import SOURCES
from tests.benchmarks.harness import Row

_OFFSET_S = 0.037
_WIDTH, _HEIGHT, _RATE_HZ = 1280, 1024, 60.0


def run(full: bool) -> Iterator[Row]:
    """Measure all; with `full` two hundred moves, a hundred faults of each kind, and 3,600 frames."""
    yield from _clocks(200 if full else 20)
    yield from _faults(100 if full else 3)
    yield from _camera(3600 if full else 300)
    yield from _gige_vision(3600 if full else 100)


def _clocks(moves: int) -> Iterator[Row]:
    errors, sigmas = [], []
    for seed in range(moves):
        rng = np.random.default_rng(seed)
        robot_s = np.sort(np.arange(0, 6, 0.008) + rng.uniform(-0.001, 0.001, 750))
        seen_s = np.linspace(0.6, 5.4, 145) + rng.uniform(-0.005, 0.005, 145)
        s = np.sin(2 * np.pi * 0.7 * seen_s)
        positions = np.sin(2 * np.pi * 0.7 * robot_s)[:, None] * [20.0, 8.0, 5.0] + rng.normal(0, 0.01, (750, 3))
        arcs = np.column_stack([18.0 * s, 180.0 - 7.0 * s, np.sqrt(400.0 - (10.0 + 5.0 * s) ** 2)])
        found = clock_offset(robot_s, positions, seen_s + _OFFSET_S, arcs + rng.normal(0, 0.02, arcs.shape))
        errors.append(found.offset_s - _OFFSET_S)
        sigmas.append(found.sigma_s)
    worst_ms = 1000 * float(np.max(np.abs(errors)))
    yield Row(
        "clock offset of 37 ms: largest error", "≤ 1 ms", f"{worst_ms:.3f} ms ({moves} moves)", worst_ms <= 1
    )
    ratio = float(np.sqrt(np.mean((np.array(errors) / sigmas) ** 2)))
    yield Row("its error by its standard deviation, RMS", "0.8 … 1.25", f"{ratio:.2f}", 0.8 <= ratio <= 1.25)


class _Watched:
    """A robot's link to the simulated cell, and whether each pose that came over it is the true one."""

    def __init__(self) -> None:
        self.devices = SimulatedDevices("tcp", 1, travel_s=0.3)
        self.wrong = self.taken = 0
        source = SOURCES.get("ur-rtde")
        settings = source.settings(host="127.0.0.1", port=self.devices.robot.port)
        self.link = Link("robot", source, settings, self._take, lambda _: None)
        self.link.start()

    def _take(self, _: str, reading: Reading) -> None:
        assert isinstance(reading, Sample)
        assert reading.device_time_s is not None
        assert reading.base_from_tool0 is not None
        moment = self.devices.cell.at(reading.device_time_s)
        if not moment.moving:  # on its way the server's two looks at the clock differ
            true = RigidTransform(moment.reported, "base", "tool0")
            self.wrong += bool(np.abs(true.difference(reading.base_from_tool0)).max() > 1e-6)
        self.taken += 1

    def wait(self, *statuses: str) -> float:
        began_s = time.perf_counter()
        while self.link.state().status not in statuses:
            assert time.perf_counter() - began_s < 30, self.link.state()
            time.sleep(0.005)
        return time.perf_counter() - began_s

    def stop(self) -> None:
        self.link.stop()
        self.devices.stop()


def _faults(times: int) -> Iterator[Row]:
    watched = _Watched()
    robot = watched.devices.robot
    outputs = robot._outputs  # the fault is put in its place

    def slow() -> Any:
        time.sleep(0.8)
        return outputs()

    def nonsense(cycle_s: float) -> Any:
        return {**outputs(cycle_s), "actual_TCP_pose": (float("nan"),) * 6}

    def cut() -> None:
        robot.is_out.set()
        robot.cut()

    def replaced(function: Callable[[float], Any]) -> Callable[[], None]:
        return lambda: setattr(robot, "_outputs", function)

    def hang(cycle_s: float) -> Any:
        time.sleep(3.0)
        return outputs(cycle_s)

    kinds: dict[str, tuple[Callable[[], None], tuple[str, ...]]] = {
        "cable out": (cut, ("lost",)),
        "server restarted": (robot.cut, ("lost",)),
        "device hangs": (replaced(hang), ("silent", "lost")),
        "device sends nonsense": (replaced(nonsense), ("nonsense", "lost")),
    }
    try:
        watched.wait("live")
        for what, (fault, statuses) in kinds.items():
            said, back = [], []
            for number in range(times):
                watched.devices.go(number % 14)
                time.sleep(0.1)
                fault()
                said.append(watched.wait(*statuses))
                robot.is_out.clear()
                robot._outputs = outputs
                back.append(watched.wait("live"))
                before = watched.taken
                while watched.taken == before:
                    time.sleep(0.005)
            measured = f"{max(said):.2f} s, back within {max(back):.2f} s ({times} times)"
            yield Row(f"{what}: said within", "≤ 2 s", measured, max(said) <= 2.0)
        yield Row("wrong poses among those taken", "0", f"{watched.wrong} of {watched.taken}", watched.wrong == 0)
    finally:
        watched.stop()


def _camera(frames: int) -> Iterator[Row]:
    images = [lossless(image, 1)[1] for image in _images()]  # as the sources of cameras write them
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    camera = context.Process(target=_serve_camera, args=(there,), daemon=True)
    camera.start()
    url = here.recv()
    cell = parse_cell({"pose_convention": "abb", "sphere_diameter_mm": 40.0})
    lens = CameraModel.from_names([[20000.0, 0, 640], [0, 20000.0, 512], [0, 0, 1]], {}, (_WIDTH, _HEIGHT))
    optics = ProfileCalibration.of(lens, [0.0, -0.5, 0.8660254], 900.0)

    def take(*_: Any) -> Any:
        raise InputError("nothing", "a capture", "Do not take any.")

    live = LiveCell(lambda: (cell, set(), lambda: optics), take, CaptureSettings())
    source = SOURCES.get("image-stream")
    link = Link("camera", source, source.settings(url=url), live.arrived, lambda _: None)
    with tempfile.TemporaryDirectory() as folder:
        live.add(link)
        while (newest := live.newest()[2]) is None or newest.picture is None or newest.picture.stripe is None:
            time.sleep(0.05)
        recording = live.recording = Recording(Path(folder))
        began_s = host_now_s()
        ages: list[float] = []
        seen = live.version
        while recording.written < frames:
            if live.version != seen:  # as the page's WebSocket asks
                seen = live.version
                exposure = live.newest()[2]
                assert exposure is not None
                assert exposure.picture is not None
                preview_jpeg(exposure.picture)
                ages.append(host_now_s() - (exposure.frame.device_time_s or 0.0))
            time.sleep(0.01)
        seconds = host_now_s() - began_s
        live.recording = None
        recorded = recording.end()
        live.stop()
        camera.terminate()
        camera.join()
        order = [images.index(path.read_bytes()) for path in recorded.files]  # ValueError where one was changed
        gaps = sum((later - earlier - 1) % len(images) for earlier, later in pairwise(order))
    what = f"camera of {_WIDTH}×{_HEIGHT} at {len(recorded.files) / seconds:.0f} frames a second"
    yield Row(f"{what}: frames lost on their way to the disk", "0", f"{gaps} of {frames}", gaps == 0)
    yield Row("the files hold what was sent, byte for byte", "all", f"{len(order)}", len(order) >= frames)
    rate, late_ms = len(ages) / seconds, 1000 * float(np.percentile(ages[5:], 95))
    yield Row("previews with stripe, as JPEG, a second", "≥ 10", f"{rate:.0f}", rate >= 10)
    yield Row("a preview's age when it is sent, 95 %", "≤ 150 ms", f"{late_ms:.0f} ms", late_ms <= 150)
    cost_ms = _cost_of_preview(images[0], cell, optics)
    yield Row("processor time of one preview, from file to JPEG", "", f"{cost_ms:.1f} ms", True)
    yield Row(
        "load average of the machine meanwhile", "", f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", True
    )


def _serve_camera(there: Any) -> None:
    """Be the camera, in a process of its own."""
    images = [lossless(image, 1)[1] for image in _images()]
    made = iter(range(10**9))
    server = StreamServer(lambda: (images[next(made) % len(images)], "image/bmp", time.monotonic()), _RATE_HZ)
    there.send(server.url)
    there.poll(600)  # until the benchmark ends
    server.stop()


def _cost_of_preview(image: bytes, cell: Any, optics: ProfileCalibration) -> float:
    took = []
    for _ in range(20):
        began_s = time.thread_time()
        picture = exposure_of(Frame(0.0, "1.bmp", image), cell, lambda: optics).picture
        assert picture is not None
        preview_jpeg(picture)
        took.append(time.thread_time() - began_s)
    return 1000 * float(np.median(took))


def _gige_vision(frames: int) -> Iterator[Row]:
    """The simulated cell's camera, in a process of its own, and Aravis's fake one, which sends nothing again."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    camera = context.Process(target=_serve_gige, args=(there,), daemon=True)
    camera.start()
    here.recv()
    try:
        yield _blocks_missing("simulated camera", frames)
    finally:
        here.send("stop")
        again = here.recv()
        camera.join()
    yield Row("its packets that got lost and were sent again", "", str(again), True)
    program = shutil.which("arv-fake-gv-camera-0.8")
    if program is None:
        return
    fake = subprocess.Popen([program, "-i", "127.0.0.1"])
    try:
        yield _blocks_missing("Aravis's fake camera, which keeps no packets", frames, Width=_WIDTH, Height=_HEIGHT)
    finally:
        fake.kill()
        fake.wait()


def _serve_gige(there: Any) -> None:
    images = list(_images())
    made = iter(range(10**9))
    server = GigeServer(
        lambda _: (images[next(made) % len(images)], time.monotonic()), (_WIDTH, _HEIGHT), _RATE_HZ
    )
    there.send("ready")
    there.recv()
    server.stop()
    there.send(server.sent_again)


def _blocks_missing(camera: str, frames: int, **features: int) -> Row:
    """Receive frames by the source of cameras while they are written to the disk, and count the blocks missing."""
    source = SOURCES.get("genicam")
    settings = source.settings(
        features={name: str(value) for name, value in features.items()}, frame_rate_hz=_RATE_HZ, exposure_us=5000.0
    )
    came: list[int] = []
    with tempfile.TemporaryDirectory() as folder:
        recording = Recording(Path(folder))

        def take(_: str, reading: Reading) -> None:
            assert isinstance(reading, Frame)
            came.append(int(Path(reading.name).stem))
            recording.expose(reading)

        link = Link("camera", source, settings, take, lambda _: None)
        try:
            link.start()
            _until(lambda: len(came) > 0)
            began_s, before = host_now_s(), len(came)
            _until(lambda: len(came) >= before + frames)
            rate = (len(came) - before) / (host_now_s() - began_s)
        finally:
            link.stop()
        recording.end()
    lost = sum((later - earlier - 1) % 65535 for earlier, later in pairwise(came))
    what = f"GigE Vision, {camera}, {_WIDTH}×{_HEIGHT} at {rate:.0f} frames a second, to the disk: blocks missing"
    return Row(what, "0", f"{lost} of {len(came)}", lost == 0)


def _until(found: Callable[[], bool]) -> None:
    began_s = host_now_s()
    while not found():
        assert host_now_s() - began_s < 200, "nothing came"
        time.sleep(0.05)


def _images() -> Iterator[Any]:
    rng = np.random.default_rng(1)
    column = np.arange(_WIDTH)
    for shift in range(6):
        x = (column - 640.0 - 3 * shift) / 400.0
        row = np.where(np.abs(x) < 0.8, 700.0 - 400.0 * np.sqrt(np.maximum(1 - x**2, 0)), 700.0)
        light = 200.0 * np.exp(-0.5 * ((np.arange(_HEIGHT)[:, None] - row) / 2.0) ** 2)
        yield np.clip(light + rng.normal(8, 2, (_HEIGHT, _WIDTH)), 0, 255).astype(np.uint8)
