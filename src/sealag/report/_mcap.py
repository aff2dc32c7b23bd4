"""Recordings as MCAP: joint states, transforms and named signals that Foxglove opens."""

import json
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from sealag.errors import FileError, InputError
from sealag.report._reserved_file import CHUNK_BYTES, ReservedFile
from sealag.typing import Array, ArrayLike

JOINT_STATES = "/joint_states"
TRANSFORMS = "/tf"

_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_XYZ = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_XYZW = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyzw"}}


def _list_of(properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "object", "properties": properties}}


_JOINT_STATES_SCHEMA = {
    "type": "object",
    "properties": {
        "timestamp": _TIME,
        "joints": _list_of(
            {
                "name": {"type": "string"},
                "position": {"type": "number"},
                "velocity": {"type": "number"},
                "effort": {"type": "number"},
            }
        ),
    },
}
_TRANSFORMS_SCHEMA = {
    "type": "object",
    "properties": {
        "transforms": _list_of(
            {
                "timestamp": _TIME,
                "parent_frame_id": {"type": "string"},
                "child_frame_id": {"type": "string"},
                "translation": _XYZ,
                "rotation": _XYZW,
            }
        )
    },
}


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


@dataclass(slots=True)
class _Channel:
    identifier: int
    names: tuple[str, ...]
    count: int = 0


@dataclass(slots=True)
class McapRecorder:
    """Writes a recording block by block; closing it, even after Ctrl-C, leaves a readable file.

    Use it as a context manager. Each block of rows becomes one message a row. Where there is no
    room for the reserve, a full disk cuts the file off behind its last whole chunk.

    Attributes:
        path: where the recording goes; it is written beside it as `<name>.partial` and renamed
            when it is closed.
        joints: names of the joints of the joint states.
        metadata: what the file says about the run: seed, versions, …
        attachments: files carried along, name to content.
    """

    path: Path
    joints: tuple[str, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    _file: Any = None
    _writer: Any = None
    _channels: dict[str, _Channel] = field(default_factory=dict)

    def __enter__(self) -> Self:
        from mcap.writer import CompressionType, Writer

        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = ReservedFile(self._partial)
            self._writer = Writer(
                self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
            )
            self._begin()
        except OSError as error:
            if self._file is not None:
                self._file.close()
                self._partial.unlink()
            raise FileError(f"{self.path} cannot be written: {error.strerror or error}.") from error
        return self

    def _begin(self) -> None:
        """Write what the file says about itself."""
        self._writer.start(profile="", library="sealag")
        for name, content in self.attachments.items():
            self._writer.add_attachment(
                create_time=0, log_time=0, name=name, media_type="text/plain", data=content
            )
        self._writer.add_metadata("run", dict(self.metadata))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        failure: OSError | None = self._file.failure
        try:
            if failure is None:
                self._writer.finish()
        except OSError as late:
            failure = late
        finally:
            self._file.close()
            os.replace(self._partial, self.path)
        if failure is not None:
            raise FileError(
                f"{self.path} is cut off: {failure.strerror or failure}; "
                "what was recorded until then is kept."
            ) from failure

    @property
    def _partial(self) -> Path:
        return self.path.with_name(self.path.name + ".partial")

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Add metadata that is known only at the end, such as the outcome.

        Args:
            name: what the record is called.
            values: keys and texts.
        """
        self._writer.add_metadata(name, dict(values))

    def write_signal(
        self, topic: str, names: Sequence[str], time: ArrayLike, *, values: ArrayLike
    ) -> None:
        """Write a block of a named signal.

        Args:
            topic: such as `/energy`.
            names: (k,) column names, the same at each call for a topic.
            time: (N,) s.
            values: (N, k).

        Raises:
            InputError: the shapes do not fit.
            FileError: the disk is full; what came before is kept.
        """
        schema = {
            "type": "object",
            "properties": {"timestamp": _TIME, **{name: {"type": "number"} for name in names}},
        }
        channel = self._channel(topic, f"sealag.{topic.strip('/')}", schema, tuple(names))
        for stamp, row in self._rows(topic, time, values, len(channel.names)):
            message = {"timestamp": _stamp(stamp), **dict(zip(channel.names, row, strict=True))}
            self._add(channel, stamp, message)

    def write_joint_states(
        self, time: ArrayLike, position: ArrayLike, velocity: ArrayLike, *, effort: ArrayLike
    ) -> None:
        """Write a block of joint states.

        Args:
            time: (N,) s.
            position: (N, n) rad.
            velocity: (N, n) rad/s.
            effort: (N, n) spring torque, Nm.

        Raises:
            InputError: the shapes do not fit.
            FileError: the disk is full; what came before is kept.
        """
        n = len(self.joints)
        parts = [np.atleast_2d(np.asarray(part, float)) for part in (position, velocity, effort)]
        channel = self._channel(
            JOINT_STATES, "foxglove.JointStates", _JOINT_STATES_SCHEMA, self.joints
        )
        for stamp, row in self._rows(JOINT_STATES, time, np.hstack(parts), 3 * n):
            joints = [
                {"name": name, "position": row[k], "velocity": row[n + k], "effort": row[2 * n + k]}
                for k, name in enumerate(self.joints)
            ]
            self._add(channel, stamp, {"timestamp": _stamp(stamp), "joints": joints})

    def write_transforms(
        self, frames: Sequence[str], time: ArrayLike, poses: ArrayLike, *, parent: str = "world"
    ) -> None:
        """Write a block of frame poses.

        Args:
            frames: (k,) names of the child frames.
            time: (N,) s.
            poses: (N, 7 k): position x, y, z in m and quaternion x, y, z, w of each frame.
            parent: the frame in which the poses are given.

        Raises:
            InputError: the shapes do not fit.
            FileError: the disk is full; what came before is kept.
        """
        channel = self._channel(
            TRANSFORMS, "foxglove.FrameTransforms", _TRANSFORMS_SCHEMA, tuple(frames)
        )
        for stamp, row in self._rows(TRANSFORMS, time, poses, 7 * len(frames)):
            transforms = [
                {
                    "timestamp": _stamp(stamp),
                    "parent_frame_id": parent,
                    "child_frame_id": frame,
                    "translation": dict(zip("xyz", row[7 * k : 7 * k + 3], strict=True)),
                    "rotation": dict(zip("xyzw", row[7 * k + 3 : 7 * k + 7], strict=True)),
                }
                for k, frame in enumerate(frames)
            ]
            self._add(channel, stamp, {"transforms": transforms})

    def _rows(
        self, topic: str, time: ArrayLike, values: ArrayLike, width: int
    ) -> Iterator[tuple[float, list[float]]]:
        times = np.atleast_1d(np.asarray(time, float))
        table = np.atleast_2d(np.asarray(values, float))
        if table.shape != (len(times), width):
            raise InputError(
                f"Topic {topic}: values have shape {table.shape}; "
                f"{len(times)} times and {width} columns need ({len(times)}, {width})."
            )
        return zip(times.tolist(), table.tolist(), strict=True)

    def _channel(
        self, topic: str, schema_name: str, schema: dict[str, Any], names: tuple[str, ...]
    ) -> _Channel:
        channel = self._channels.get(topic)
        if channel is None:
            schema_id = self._writer.register_schema(
                name=schema_name, encoding="jsonschema", data=json.dumps(schema).encode()
            )
            channel = _Channel(
                self._writer.register_channel(
                    topic=topic,
                    message_encoding="json",
                    schema_id=schema_id,
                    metadata={"names": json.dumps(names)},
                ),
                names,
            )
            self._channels[topic] = channel
        if channel.names != names:
            raise InputError(f"Topic {topic} was begun with the columns {channel.names}.")
        return channel

    def _add(self, channel: _Channel, time: float, message: dict[str, Any]) -> None:
        nanoseconds = round(time * 1e9)
        self._writer.add_message(
            channel_id=channel.identifier,
            log_time=nanoseconds,
            publish_time=nanoseconds,
            sequence=channel.count,
            data=json.dumps(message, separators=(",", ":")).encode(),
        )
        channel.count += 1
        if self._file.full:
            raise FileError(
                f"{self.path} stops at {time:.3f} s because the disk is full; "
                "what was recorded until then is kept."
            )


def _stamp(time: float) -> dict[str, int]:
    seconds, nanoseconds = divmod(round(time * 1e9), 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def read_recording(path: str | Path) -> RecordingFile:
    """Read a recording back as arrays, also one that was cut off.

    Args:
        path: an MCAP file that `McapRecorder` wrote.

    Returns:
        Its signals, metadata and attachments.

    Raises:
        FileError: the file is missing or is no MCAP file.
    """
    from mcap.exceptions import McapError
    from mcap.records import Attachment, Channel, Footer, Message, Metadata
    from mcap.stream_reader import StreamReader

    channels: dict[int, Any] = {}
    rows: dict[int, list[tuple[float, list[float]]]] = {}
    metadata: dict[str, str] = {}
    attachments: dict[str, bytes] = {}
    complete = False
    try:
        with open(path, "rb") as file:
            if file.read(5) != b"\x89MCAP":
                raise FileError(f"{path} is not an MCAP recording.")
            file.seek(0)
            try:
                for record in StreamReader(file).records:
                    match record:
                        case Channel():
                            channels[record.id] = record
                        case Message():
                            row = _row(channels[record.channel_id].topic, record.data)
                            rows.setdefault(record.channel_id, []).append(
                                (record.log_time * 1e-9, row)
                            )
                        case Metadata():
                            metadata.update(record.metadata)
                        case Attachment():
                            attachments[record.name] = record.data
                        case Footer():
                            complete = True
            except (McapError, struct.error):
                complete = False
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    signals = {channels[key].topic: _signal(channels[key], found) for key, found in rows.items()}
    return RecordingFile(
        signals=signals, metadata=metadata, attachments=attachments, complete=complete
    )


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
