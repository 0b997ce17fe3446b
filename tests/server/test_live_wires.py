"""Faults on a source's wire, in the midst of what is told: what came whole is read, nothing is invented."""

import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.robots import parse_pose
from server.sources.device import Device, Sample
from tests.server.connected_device import connected
from tests.server.test_live_robot_sources import TELEGRAM, egm_message, free_port

_RECORDS = 30
_FAULTY = 12  # the record that the fault meets


def place_mm(number: int) -> tuple[float, float, float]:
    """Where the robot is at a record: no part of one place goes with a part of another."""
    return 1000.5 + number, 2000.25 + 2 * number, 300.125 + 3 * number


def kuka_line(number: int) -> bytes:
    return "{:.3f} {:.3f} {:.3f} 10 20 30\r\n".format(*place_mm(number)).encode()


def eki_element(number: int) -> bytes:
    x, y, z = place_mm(number)
    return f'<Robot><Pos X="{x}" Y="{y}" Z="{z}" A="10" B="20" C="30"/></Robot>\r\n'.encode()


SOURCES: dict[str, Callable[[int], bytes]] = {"pose-lines": kuka_line, "kuka-eki": eki_element}


def cut(record: bytes) -> Sequence[bytes | None]:
    return record[: len(record) // 2], None


def delayed(record: bytes) -> Sequence[bytes | None]:
    return record[:9], b"", record[9:]


def byte_by_byte(record: bytes) -> Sequence[bytes | None]:
    return [record[k : k + 1] for k in range(len(record))]


def duplicated(record: bytes) -> Sequence[bytes | None]:
    return record, record


def garbled(record: bytes) -> Sequence[bytes | None]:
    middle = len(record) // 2
    return [record[: middle - 2] + b"\xff\x00\xfe" + record[middle + 1 :]]


def split_in_two(record: bytes) -> Sequence[bytes | None]:
    """Two records in one line, as a gateway joins them that loses line ends."""
    return [record.rstrip(b"\r\n") + record]


FAULTS = [cut, delayed, byte_by_byte, duplicated, garbled, split_in_two]


@contextmanager
def controller(
    record_of: Callable[[int], bytes], fault: Callable[[bytes], Sequence[bytes | None]]
) -> Iterator[int]:
    """Tell one record after the other to whoever connects, one of them through a fault; None hangs up."""
    listening = socket.create_server(("127.0.0.1", 0))
    todo = list(range(_RECORDS))
    begun = [False]

    def serve(peer: socket.socket) -> None:
        while todo:
            number = todo[0]
            record = record_of(number)
            faulty = number == _FAULTY and not begun[0]
            begun[0] |= faulty
            for chunk in fault(record) if faulty else (record,):
                if chunk is None:
                    return
                if not chunk:
                    time.sleep(0.7)  # longer than a read waits
                peer.sendall(chunk)
            todo.pop(0)
        peer.settimeout(60)
        peer.recv(1)

    def run() -> None:
        with suppress(OSError):
            while todo:
                peer, _ = listening.accept()
                with peer:
                    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    serve(peer)

    threading.Thread(target=run, daemon=True).start()
    try:
        yield listening.getsockname()[1]
    finally:
        listening.close()


def told(connect: Callable[[], Device]) -> tuple[list[int], int]:
    """Return the numbers of all records that were read until the last, and how often something was refused."""
    numbers: list[int] = []
    refused, device, ends_s = 0, connect(), time.monotonic() + 60
    try:
        while not numbers or numbers[-1] != _RECORDS - 1:
            assert time.monotonic() < ends_s, numbers
            try:
                reading = device.read()
            except InputError:
                refused += 1
            except OSError:
                refused += 1
                device.close()
                device = connect()
            else:
                if reading is not None:
                    numbers.append(number_of(reading))
    finally:
        device.close()
    return numbers, refused


def number_of(reading: object) -> int:
    """Return which record a reading is; a pose that none of them told fails."""
    assert isinstance(reading, Sample)
    assert reading.base_from_tool0 is not None
    number = round(reading.base_from_tool0.translation_mm[0] - place_mm(0)[0])
    true = parse_pose("kuka", [*place_mm(number), 10, 20, 30])
    assert np.abs(true.difference(reading.base_from_tool0)).max() < 1e-6
    return number


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
@pytest.mark.parametrize("source", SOURCES)
def test_a_fault_in_the_midst_of_a_record_loses_at_most_that_and_invents_nothing(
    source: str, fault: Callable[[bytes], Sequence[bytes | None]]
) -> None:
    with controller(SOURCES[source], fault) as port:
        numbers, refused = told(lambda: connected(source, host="127.0.0.1", port=port))
    lost = set(range(_RECORDS)) - set(numbers)
    twice = len(numbers) - len(set(numbers))
    assert numbers == sorted(numbers)
    if fault in (delayed, byte_by_byte):
        assert (lost, twice, refused) == (set(), 0, 0)
    elif fault is cut:
        assert (lost, twice) == (set(), 0)
        assert refused >= 1
    elif fault is duplicated:
        assert (lost, twice, refused) == (set(), 1, 0)
    else:
        assert lost <= {_FAULTY}
        assert bool(lost) == bool(refused)


@pytest.mark.parametrize(
    ("source", "datagram", "settings"),
    [("kuka-rsi", TELEGRAM.encode(), {"host": "127.0.0.1"}), ("abb-egm", egm_message(123_456), {})],
    ids=["kuka-rsi", "abb-egm"],
)
def test_of_a_datagram_that_is_cut_short_no_other_pose_is_read(
    source: str, datagram: bytes, settings: dict[str, str]
) -> None:
    port = free_port(socket.SOCK_DGRAM)
    device = connected(source, port=port, robot="127.0.0.1", **settings)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:

        def read(content: bytes) -> Sample | None:
            robot.sendto(content, ("127.0.0.1", port))
            reading = device.read()
            assert reading is None or isinstance(reading, Sample)
            return reading

        whole = read(datagram)
        assert whole is not None
        assert whole.base_from_tool0 is not None
        for length in range(1, len(datagram)):
            with suppress(InputError):
                found = read(datagram[:length])
                if found is not None and found.base_from_tool0 is not None:
                    assert np.abs(whole.base_from_tool0.difference(found.base_from_tool0)).max() < 1e-9, length
        again = read(datagram)
        assert again is not None
        assert again.base_from_tool0 is not None
    device.close()
