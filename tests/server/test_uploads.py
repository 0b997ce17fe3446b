"""How much of the uploads is in memory at once."""

import threading

from server.http.uploads import Room


def test_uploads_wait_for_room_and_none_is_shut_out() -> None:
    room = Room(100)
    most = now = 0
    lock = threading.Lock()

    def hold(size: int) -> None:
        nonlocal most, now
        with room.taken(size):
            with lock:
                now += size
                most = max(most, now)
            waiting.wait(0.01)
            with lock:
                now -= size

    waiting = threading.Event()
    threads = [threading.Thread(target=hold, args=(size,)) for size in [40, 60, 30, 70, 100, 90, 20] * 4]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=30)
    assert not any(thread.is_alive() for thread in threads)
    assert 60 <= most <= 100
    with room.taken(1000):  # more than all of it, but alone
        pass
