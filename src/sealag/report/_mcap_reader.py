"""Recordings as MCAP, read back as arrays."""

import json
import struct
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sealag.errors import FileError, InputError
from sealag.files import opened
from sealag.report._mcap import JOINT_STATES, TRANSFORMS
from sealag.typing import Array

_FOREIGN = (AttributeError, KeyError, TypeError, ValueError)
"""How the messages of others look to who expects sealag's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """One topic of a recording, as arrays.

    Attributes:
        time: (N,) s, as recorded.
        names: the columns' names.
        values: (N, len(names)) in the units that the names state.
    """

    time: Array
    names: tuple[str, ...]
    values: Array

    def column(self, name: str) -> Array:
        """Return one column.

        Args:
            name: one of `names`.

        Raises:
            InputError: there is no such column.
        """
        if name not in self.names:
            raise InputError(f"The signal has no column {name!r}; it has {', '.join(self.names)}.")
        return self.values[:, self.names.index(name)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingFile:
    """What a recording holds.

    Attributes:
        signals: topic to signal; joint states have columns `<joint>:position`, `:velocity`,
            `:effort`, transforms `<frame>:x` … `:qw`.
        metadata: seed, versions, outcome and whatever else the run wrote about itself.
        attachments: files that the run carries along, such as its project file.
        complete: whether the file was closed; a cut-off file still gives what it holds.
    """

    signals: Mapping[str, Signal]
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes]
    complete: bool


def read_recording(path: str | Path) -> RecordingFile:
    """Read a recording back as arrays, also one that was cut off or damaged, up to there.

    Args:
        path: an MCAP file that `McapRecorder` wrote.

    Returns:
        Its signals, metadata and attachments.

    Raises:
        FileError: the file is missing, is no MCAP file, or one that sealag did not write.
    """
    from mcap.exceptions import McapError
    from mcap.records import Attachment, Channel, Footer, Message, Metadata
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    channels: dict[int, Any] = {}
    rows: dict[int, list[tuple[float, list[float]]]] = {}
    metadata: dict[str, str] = {}
    attachments: dict[str, bytes] = {}
    complete = False
    path = Path(path)
    with opened(path, what="The recording", largest=sys.maxsize) as file:
        if file.read(5) != b"\x89MCAP":
            raise FileError(f"{path} is not an MCAP recording.")
        file.seek(0)
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                match record:
                    case Channel():
                        channels.setdefault(record.id, record)  # the summary's again
                    case Message():
                        row = _row(channels[record.channel_id].topic, record.data)
                        rows.setdefault(record.channel_id, []).append((record.log_time * 1e-9, row))
                    case Metadata():
                        metadata.update(record.metadata)
                    case Attachment():
                        attachments[record.name] = record.data
                    case Footer():
                        complete = True
        except (McapError, ZstdError, struct.error):
            complete = False
        except _FOREIGN as error:
            raise _not_ours(path) from error
    try:
        signals = {channels[at].topic: _signal(channels[at], found) for at, found in rows.items()}
    except _FOREIGN as error:
        raise _not_ours(path) from error
    return RecordingFile(
        signals=signals, metadata=metadata, attachments=attachments, complete=complete
    )


def _not_ours(path: Path) -> FileError:
    return FileError(f"{path} is an MCAP file, but no recording that sealag wrote.")


def _row(topic: str, data: bytes) -> list[float]:
    message = json.loads(data)
    if topic == JOINT_STATES:
        return [j[key] for key in ("position", "velocity", "effort") for j in message["joints"]]
    if topic == TRANSFORMS:
        return [
            value
            for t in message["transforms"]
            for value in (*t["translation"].values(), *t["rotation"].values())
        ]
    return [value for key, value in message.items() if key != "timestamp"]


def _signal(channel: Any, found: list[tuple[float, list[float]]]) -> Signal:
    names = tuple(json.loads(channel.metadata["names"]))
    if channel.topic == JOINT_STATES:
        names = tuple(f"{j}:{key}" for key in ("position", "velocity", "effort") for j in names)
    elif channel.topic == TRANSFORMS:
        keys = ("x", "y", "z", "qx", "qy", "qz", "qw")
        names = tuple(f"{frame}:{key}" for frame in names for key in keys)
    return Signal(
        time=np.array([time for time, _ in found]),
        names=names,
        values=np.array([row for _, row in found], dtype=float),
    )
