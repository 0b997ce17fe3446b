"""ROS bags, rosbag 2's SQLite and MCAP: their messages, by the library rosbags."""

from collections.abc import Collection, Iterator
from typing import Any

from calib_core.disk import temporary_folder
from calib_core.errors import InputError
from calib_core.messages import message

MCAP, SQLITE = b"\x89MCAP0\r\n", b"SQLite format 3\0"
_LARGEST_BYTES = 256_000_000
_MOST_MESSAGES = 1_000_000


def is_bag(data: bytes) -> bool:
    """Return whether data begin like a recording."""
    return data.startswith((MCAP, SQLITE))


def bag_messages(data: bytes, name: str, types: Collection[str]) -> Iterator[tuple[str, str, float, Any]]:
    """Yield topic, type, time of recording in seconds, and message, of the types that are wanted.

    Raises
    ------
    InputError
        If the library is not installed, or the recording is damaged, too large, or has over a million messages.
    """
    if len(data) > _LARGEST_BYTES:
        to_do = message("Record the poses' topics alone: ros2 bag record /tf /tf_static.")
        need = "a file of at most {limit_mb:g} MB"
        raise InputError(
            need, "{size_mb:.0f} MB", to_do, name, limit_mb=_LARGEST_BYTES / 1e6, size_mb=len(data) / 1e6
        )
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError:
        to_do = message("Install it: pip install 'scancell[{extra}]'.", extra="ros")
        raise InputError("the extra '{extra}'", "none", to_do, name, extra="ros") from None
    with temporary_folder() as folder:
        file = folder / ("bag.mcap" if data.startswith(MCAP) else "bag.db3")
        file.write_bytes(data)
        try:
            with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
                wanted = [connection for connection in reader.connections if connection.msgtype in types]
                if not wanted:
                    topics = (
                        ", ".join(sorted(f"{c.topic} ({c.msgtype})" for c in reader.connections)[:8]) or "none"
                    )
                    to_do = message("Record topics of the types {types}.", types=", ".join(sorted(types)))
                    need = "a recording with poses or transforms"
                    raise InputError(need, "the topics {topics}", to_do, name, topics=topics)
                for count, (connection, time_ns, raw) in enumerate(reader.messages(wanted)):
                    if count >= _MOST_MESSAGES:
                        to_do = message("Cut the recording: ros2 bag convert.")
                        raise InputError("at most a million messages", "more", to_do, name)
                    yield (
                        connection.topic,
                        connection.msgtype,
                        time_ns * 1e-9,
                        reader.deserialize(raw, connection.msgtype),
                    )
        except InputError:
            raise
        except Exception as error:  # the library's readers raise whatever a damaged byte leads to
            got = " ".join(str(error).split())[:160] or type(error).__name__
            need = "a whole recording"
            raise InputError(need, got, "Copy it again; ros2 bag reindex may mend it.", name) from None
