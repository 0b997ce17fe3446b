"""CRC-32C (Castagnoli) of many rows of bytes: the checksum of E57's pages."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_REVERSED_POLYNOMIAL = 0x82F63B78


def _table() -> NDArray[np.uint32]:
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(_REVERSED_POLYNOMIAL), table >> 1).astype(np.uint32)
    return table


_TABLE = _table()


@njit(cache=True, nogil=True)
def crc32c_rows(rows: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return the checksum (N,) of each row (N, B)."""
    result = np.empty(rows.shape[0], np.uint32)
    for n in range(rows.shape[0]):
        value = np.uint32(0xFFFFFFFF)
        for byte in rows[n]:
            value = (value >> np.uint32(8)) ^ _TABLE[(value ^ byte) & np.uint32(0xFF)]
        result[n] = value ^ np.uint32(0xFFFFFFFF)
    return result
