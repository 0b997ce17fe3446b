"""The registers of the simulated GigE Vision camera, and the GenICam XML that tells where its features lie."""

import struct
from collections.abc import Mapping

MANUFACTURER, MODEL = "scancell", "Simulated camera"
MONO8 = 0x0108_0001
TICKS_HZ = 1_000_000_000

DISCOVERY_BYTES = 0xF8
_CAPABILITY, _HEARTBEAT = 0x0934, 0x0938
TICK_FREQUENCY = 0x093C
TIMESTAMP_CONTROL, TIMESTAMP_VALUE = 0x0944, 0x0948
CONTROL = 0x0A00
STREAM_PORT, PACKET_SIZE, _PACKET_DELAY, STREAM_ADDRESS = 0x0D00, 0x0D04, 0x0D08, 0x0D18
_URL, _XML = 0x0200, 0x2000_0000
WIDTH, HEIGHT, PIXEL_FORMAT, PAYLOAD = 0x1000_0000, 0x1000_0004, 0x1000_0008, 0x1000_000C
ACQUISITION, MODE, LOCKED = 0x1000_0010, 0x1000_0014, 0x1000_0018
FRAME_RATE, EXPOSURE = 0x1000_0020, 0x1000_0024
WRITABLE = frozenset(
    (
        CONTROL, _HEARTBEAT, TIMESTAMP_CONTROL, STREAM_PORT, PACKET_SIZE, _PACKET_DELAY, STREAM_ADDRESS,
        ACQUISITION, MODE, LOCKED, FRAME_RATE, EXPOSURE,
    )
)  # fmt: skip
_RESEND_AND_WRITE = 0b110
_PACKET_BYTES = 8000


class Registers:
    """The camera's memory: big-endian words by their address, and the XML."""

    def __init__(self, address: str, size: tuple[int, int], rate_hz: float, exposure_us: float) -> None:
        self._xml = _xml().encode("ascii")
        self._low = bytearray(0x1000)
        self._high = bytearray(0x40)
        width, height = size
        octets = struct.unpack(">I", bytes(map(int, address.split("."))))[0]
        words = {
            0x0000: 0x0001_0002, 0x0004: 0x8000_0001, 0x0008: 0x0000_0200, 0x000C: octets,
            0x0010: 0x4, 0x0014: 0x4, 0x0024: octets, 0x0034: 0xFF00_0000, 0x0600: 1, 0x0904: 1,
            _CAPABILITY: _RESEND_AND_WRITE, _HEARTBEAT: 3000,
            TICK_FREQUENCY + 4: TICKS_HZ, PACKET_SIZE: _PACKET_BYTES,
            WIDTH: width, HEIGHT: height, PIXEL_FORMAT: MONO8, PAYLOAD: width * height,
        }  # fmt: skip
        for place, value in words.items():
            self.write(place, value)
        for place, value in ((FRAME_RATE, rate_hz), (EXPOSURE, exposure_us)):
            self.write_bytes(place, struct.pack(">f", value))
        url = f"Local:scancell.xml;{_XML:X};{len(self._xml):X}"
        for place, text in {0x48: MANUFACTURER, 0x68: MODEL, 0x88: "1", 0xD8: address, _URL: url}.items():
            self.write_bytes(place, text.encode("ascii"))

    def read(self, address: int, count: int = 4) -> bytes:
        """Return bytes; raises KeyError outside of the memory."""
        for start, memory in ((0, self._low), (WIDTH, self._high), (_XML, self._xml)):
            if start <= address < start + len(memory):
                found = bytes(memory[address - start : address - start + count])
                return found + bytes(count - len(found))
        raise KeyError(address)

    def write_bytes(self, address: int, content: bytes) -> None:
        """Write bytes; raises KeyError outside of the memory."""
        for start, memory in ((0, self._low), (WIDTH, self._high)):
            if start <= address and address + len(content) <= start + len(memory):
                memory[address - start : address - start + len(content)] = content
                return
        raise KeyError(address)

    def word(self, address: int) -> int:
        """Return a word; raises KeyError outside of the memory."""
        return int.from_bytes(self.read(address), "big")

    def write(self, address: int, value: int) -> None:
        """Write a word; raises KeyError outside of the memory."""
        self.write_bytes(address, value.to_bytes(4, "big"))

    def number(self, address: int) -> float:
        """Return a word that is a floating-point number."""
        return float(struct.unpack(">f", self.read(address))[0])


def _register(kind: str, name: str, address: int, length: int, access: str, more: str = "") -> str:
    return (
        f'<{kind} Name="{name}"><Address>0x{address:X}</Address><Length>{length}</Length>'
        f"<AccessMode>{access}</AccessMode><pPort>Device</pPort>{more}</{kind}>"
    )


def _integer(name: str, address: int, access: str) -> str:
    return _register("IntReg", name, address, 4, access, "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess>")


def _float(name: str, address: int, low: float, high: float, unit: str) -> str:
    register = _register("FloatReg", f"{name}Reg", address, 4, "RW", "<Endianess>BigEndian</Endianess>")
    limits = f"<Min>{low}</Min><Max>{high}</Max><Unit>{unit}</Unit>"
    return f'<Float Name="{name}"><pValue>{name}Reg</pValue>{limits}</Float>{register}'


def _enumeration(name: str, address: int, entries: Mapping[str, int], access: str) -> str:
    listed = "".join(
        f'<EnumEntry Name="{entry}"><Value>{value}</Value></EnumEntry>' for entry, value in entries.items()
    )
    register = _integer(f"{name}Reg", address, access)
    return f'<Enumeration Name="{name}">{listed}<pValue>{name}Reg</pValue></Enumeration>{register}'


def _command(name: str, value: int) -> str:
    register = f"<pValue>AcquisitionReg</pValue><CommandValue>{value}</CommandValue>"
    return f'<Command Name="{name}">{register}</Command>'


_CATEGORIES = {
    "DeviceControl": ("DeviceVendorName", "DeviceModelName"),
    "ImageFormatControl": ("Width", "Height", "PixelFormat"),
    "AcquisitionControl": (
        "AcquisitionMode", "AcquisitionStart", "AcquisitionStop", "AcquisitionFrameRate", "ExposureTime",
    ),
    "TransportLayerControl": ("PayloadSize", "TLParamsLocked", "GevTimestampTickFrequency", "GevSCPSPacketSize"),
}  # fmt: skip


def _xml() -> str:
    namespace = 'xmlns="http://www.genicam.org/GenApi/Version_1_1"'
    versions = " ".join(f'{which}="{value}"' for which, value in _VERSIONS.items())
    root = "".join(f"<pFeature>{name}</pFeature>" for name in _CATEGORIES)
    parts = [f'<Category Name="Root">{root}</Category>']
    for name, features in _CATEGORIES.items():
        parts.append(
            f'<Category Name="{name}">{"".join(f"<pFeature>{f}</pFeature>" for f in features)}</Category>'
        )
    parts += [
        _register("StringReg", "DeviceVendorName", 0x48, 32, "RO"),
        _register("StringReg", "DeviceModelName", 0x68, 32, "RO"),
        _integer("Width", WIDTH, "RO"),
        _integer("Height", HEIGHT, "RO"),
        _enumeration("PixelFormat", PIXEL_FORMAT, {"Mono8": MONO8}, "RO"),
        _enumeration("AcquisitionMode", MODE, {"Continuous": 0}, "RW"),
        _integer("AcquisitionReg", ACQUISITION, "RW"),
        _command("AcquisitionStart", 1),
        _command("AcquisitionStop", 0),
        _float("AcquisitionFrameRate", FRAME_RATE, 0.5, 200.0, "Hz"),
        _float("ExposureTime", EXPOSURE, 10.0, 1e6, "us"),
        _integer("PayloadSize", PAYLOAD, "RO"),
        _integer("TLParamsLocked", LOCKED, "RW"),
        _integer("GevTimestampTickFrequency", TICK_FREQUENCY + 4, "RO"),
        _integer("GevSCPSPacketSize", PACKET_SIZE, "RW"),
        '<Port Name="Device"/>',
    ]
    head = f'<RegisterDescription {namespace} ModelName="Simulated" VendorName="scancell" {versions}>'
    return f'<?xml version="1.0" encoding="UTF-8"?>{head}{"".join(parts)}</RegisterDescription>'


_VERSIONS = {
    "StandardNameSpace": "GEV", "SchemaMajorVersion": "1", "SchemaMinorVersion": "1", "SchemaSubMinorVersion": "0",
    "MajorVersion": "1", "MinorVersion": "0", "SubMinorVersion": "0", "ToolTip": "The camera of a simulated cell",
    "ProductGuid": "7363616e-6365-6c6c-0000-000000000000", "VersionGuid": "7363616e-6365-6c6c-0000-000000000001",
}  # fmt: skip
