"""Live devices of cells: their settings in the database, their secrets in a file that is in no backup of it."""

import json
import os
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from calib_core.disk import replace_file
from calib_core.messages import message
from server.store.models import Data, DeviceRow, required

_SECRETS_FILE = "device-secrets.json"


def devices_of(db: Transaction, cell: str) -> list[DeviceRow]:
    """Return a cell's devices by name."""
    return list(db.scalars(select(DeviceRow).where(DeviceRow.cell == cell).order_by(DeviceRow.name)))


def connected_devices(db: Transaction) -> list[DeviceRow]:
    """Return the devices that are to be connected, of all cells."""
    return list(db.scalars(select(DeviceRow).where(DeviceRow.session_id.is_not(None))))


def device_row(db: Transaction, cell: str, name: str) -> DeviceRow:
    """Return a device; raises NotFoundError."""
    row, to_do = db.get(DeviceRow, (cell, name)), message("List them first.")
    return required(row, message("a device that is connected for this session"), repr(name[:64]), to_do, "device")


class DeviceSecrets:
    """Passwords and keys of devices, in a file of the data folder that its owner alone reads."""

    def __init__(self, data: Path) -> None:
        self._path = data / _SECRETS_FILE

    def get(self, cell: str, name: str) -> Data:
        """Return a device's secrets by the names of its settings."""
        return self._all().get(f"{cell}/{name}", {})

    def put(self, cell: str, name: str, secrets: Data) -> None:
        """Keep a device's secrets; none forgets them."""
        kept = self._all()
        kept.pop(f"{cell}/{name}", None)
        if secrets:
            kept[f"{cell}/{name}"] = secrets
        elif not self._path.exists():
            return
        fresh = self._path.with_suffix(".new")
        handle = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(kept, file)
        replace_file(fresh, self._path)

    def _all(self) -> dict[str, Data]:
        return json.loads(self._path.read_text(encoding="utf-8")) if self._path.exists() else {}
