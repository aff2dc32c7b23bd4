"""Recordings as MCAP, written: joint states, transforms and named signals that Foxglove opens."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from sealag.errors import FileError, InputError
from sealag.files import Draft
from sealag.report._reserved_file import CHUNK_BYTES, ReservedFile
from sealag.typing import ArrayLike

JOINT_STATES = "/joint_states"
TRANSFORMS = "/tf"

_SECONDS, _NANOSECONDS = -2, -1
_STAMP = {"sec": _SECONDS, "nsec": _NANOSECONDS}
"""A message's time: two numbers behind those of its columns."""

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


@dataclass(slots=True)
class _Channel:
    identifier: int
    topic: str
    names: tuple[str, ...]
    pattern: str
    columns: list[int]
    count: int = 0


class _DiskFullError(FileError):
    """The disk filled up; the sentence lacks where the recording is."""


@dataclass(slots=True)
class McapRecorder:
    """Writes a recording block by block; Ctrl-C meanwhile leaves what was there before.

    Use it as a context manager. Each block of rows becomes one message a row. Where there is no
    room for the reserve, a full disk cuts the file off behind its last whole chunk. A recording
    that is not whole replaces none: it becomes `<stem>.incomplete.mcap` where there is one.

    Attributes:
        path: where the recording goes, or the draft of it.
        joints: names of the joints of the joint states.
        metadata: what the file says about the run: seed, versions, …
        attachments: files carried along, name to content.
        whole: whether what is recorded came to its end.
        saved: where the recording is, once it is closed.
    """

    path: Path | Draft
    joints: tuple[str, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    whole: bool = True
    saved: Path | None = None
    _draft: Any = None
    _file: Any = None
    _writer: Any = None
    _channels: dict[str, _Channel] = field(default_factory=dict)

    def __enter__(self) -> Self:
        from mcap.writer import CompressionType, Writer

        self._draft = Draft.of(self.path)
        try:
            self._file = ReservedFile(self._draft.file, self._draft.path.parent)
            self._writer = Writer(
                self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
            )
            self._begin()
        except OSError as error:
            self._draft.drop()
            raise FileError(
                f"{self._draft.asked} cannot be written: {error.strerror or error}."
            ) from error
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
        draft, failure = self._draft, self._file.failure
        with draft:
            try:
                if failure is None:
                    self._writer.finish()
            except OSError as late:
                failure = late
            finally:
                self._file.release()
            if kind is KeyboardInterrupt:
                return
            if self.whole and kind is None and failure is None:
                draft.keep()
                self.saved = draft.asked
                return
            self.saved = saved = draft.keep_beside("incomplete")
        kept = "what was recorded until then is kept"
        if saved != draft.asked:
            kept += f" in {saved}, and {draft.asked} is as it was"
        if failure is not None:
            cut = f"{draft.asked} is cut off: {failure.strerror or failure}"
            raise FileError(f"{cut}; {kept}.") from failure
        if isinstance(error, _DiskFullError):
            raise FileError(f"{error}; {kept}.") from error

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
        channel = self._channel(
            topic,
            f"sealag.{topic.strip('/')}",
            schema,
            names=tuple(names),
            message={"timestamp": _STAMP, **{name: k for k, name in enumerate(names)}},
        )
        self._add(channel, time, values)

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
        joints = [
            {"name": name, "position": k, "velocity": n + k, "effort": 2 * n + k}
            for k, name in enumerate(self.joints)
        ]
        channel = self._channel(
            JOINT_STATES,
            "foxglove.JointStates",
            _JOINT_STATES_SCHEMA,
            names=self.joints,
            message={"timestamp": _STAMP, "joints": joints},
        )
        self._add(channel, time, np.hstack(parts))

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
        transforms = [
            {
                "timestamp": _STAMP,
                "parent_frame_id": parent,
                "child_frame_id": frame,
                "translation": {axis: 7 * k + i for i, axis in enumerate("xyz")},
                "rotation": {axis: 7 * k + 3 + i for i, axis in enumerate("xyzw")},
            }
            for k, frame in enumerate(frames)
        ]
        channel = self._channel(
            TRANSFORMS,
            "foxglove.FrameTransforms",
            _TRANSFORMS_SCHEMA,
            names=tuple(frames),
            message={"transforms": transforms},
        )
        self._add(channel, time, poses)

    def _channel(
        self,
        topic: str,
        schema_name: str,
        schema: dict[str, Any],
        *,
        names: tuple[str, ...],
        message: dict[str, Any],
    ) -> _Channel:
        """A topic's channel; `message` has the numbers of columns in place of their values."""
        channel = self._channels.get(topic)
        if channel is None:
            schema_id = self._writer.register_schema(
                name=schema_name, encoding="jsonschema", data=json.dumps(schema).encode()
            )
            identifier = self._writer.register_channel(
                topic=topic,
                message_encoding="json",
                schema_id=schema_id,
                metadata={"names": json.dumps(names)},
            )
            pattern, columns = _pattern(message)
            channel = _Channel(identifier, topic, names, pattern, columns)
            self._channels[topic] = channel
        if channel.names != names:
            raise InputError(f"Topic {topic} was begun with the columns {channel.names}.")
        return channel

    def _add(self, channel: _Channel, time: ArrayLike, values: ArrayLike) -> None:
        times = np.atleast_1d(np.asarray(time, float))
        table = np.atleast_2d(np.asarray(values, float))
        width = len(set(channel.columns) - {_SECONDS, _NANOSECONDS})
        if table.shape != (len(times), width):
            raise InputError(
                f"Topic {channel.topic}: values have shape {table.shape}; "
                f"{len(times)} times and {width} columns need ({len(times)}, {width})."
            )
        pick = itemgetter(*channel.columns)
        for stamp, row in zip(times.tolist(), table.tolist(), strict=True):
            nanoseconds = round(stamp * 1e9)
            numbers = json.dumps(row)[1:-1].split(", ")
            numbers += divmod(nanoseconds, 1_000_000_000)
            self._writer.add_message(
                channel_id=channel.identifier,
                log_time=nanoseconds,
                publish_time=nanoseconds,
                sequence=channel.count,
                data=(channel.pattern % pick(numbers)).encode(),
            )
            channel.count += 1
            if self._file.full:
                raise _DiskFullError(
                    f"{self._draft.asked} stops at {stamp:.3f} s because the disk is full"
                )


def _pattern(message: Any) -> tuple[str, list[int]]:
    """JSON with %s in place of the numbers of columns, and these numbers in order."""
    match message:
        case int():
            return "%s", [message]
        case dict():
            parts = [_pattern(value) for value in message.values()]
            names = [_pattern(name)[0] for name in message]
            texts = [f"{name}:{text}" for name, (text, _) in zip(names, parts, strict=True)]
            whole = "{" + ",".join(texts) + "}"
        case list():
            parts = [_pattern(value) for value in message]
            whole = "[" + ",".join(text for text, _ in parts) + "]"
        case _:
            return json.dumps(message).replace("%", "%%"), []
    return whole, [column for _, columns in parts for column in columns]
