"""How much of the uploads is in memory at once."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

from server.http.uploads import UploadMemory

MIB = 1 << 20


def test_uploads_wait_for_room_and_none_is_shut_out() -> None:
    most = now = 0

    async def hold(memory: UploadMemory, size: int) -> None:
        nonlocal most, now
        async with memory.taken(size * MIB):
            now += size
            most = max(most, now)
            await asyncio.sleep(0)
            now -= size

    async def all_of_them() -> None:
        memory = UploadMemory(100 * MIB)
        async with asyncio.timeout(30):
            await asyncio.gather(*(hold(memory, size) for size in [40, 60, 30, 70, 100, 90, 20] * 4))
            async with memory.taken(1000 * MIB), memory.taken(1000):  # alone, beside one too small to count
                pass

    with ThreadPoolExecutor(1) as thread:  # the browser's tests may keep a loop running in this one
        thread.submit(asyncio.run, all_of_them()).result()
    assert 60 <= most <= 100
