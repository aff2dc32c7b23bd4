"""Which columns of a table a motion needs, by their own names or by those that others use."""

import difflib
import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sealag.design._motion_table import CONTACT, STIFFNESS, VELOCITY
from sealag.errors import InputError, MotionError
from sealag.files import read_whole
from sealag.robot import Contact, Motion, Robot
from sealag.typing import Array

TIME = "time_s"
_UNIT = r"s|secs?|seconds|[mun]s|[mun]secs?|(?:milli|micro|nano)seconds"
_TIME_NAME = re.compile(
    rf"(?:_*time|%time|t|(?:header\.)?stamp|time_?stamp)"
    rf"(?:[_ ]?[\[(]({_UNIT})[\])]|[_ ]({_UNIT}))?",
    re.IGNORECASE,
)
"""time_s, time_ns, t_ms, stamp, header.stamp_ns, time [ms] and their like."""

_UNITS = {"s": 1.0, "ms": 1e-3, "milli": 1e-3, "us": 1e-6, "micro": 1e-6, "n": 1e-9}
"""By the beginning of a unit's name."""

_UNIT_NAMES = {1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
_SLOW_ROWS = 0.5
"""s between rows from which a time without a unit is asked for it. Logs have 1000 to 2 rows a
second; counted in ms that is 1 to 500, which is never taken for seconds then."""

_LOG = 20
"""Rows from which a table in s is a log, of which slow ones are mentioned: fewer are postures."""

_EPOCH = 1e6
"""s from which a first time is a date, and the motion begins at 0: doubles of dates in s have steps
of 0.24 us."""

_LARGEST_MAPPING = 1_000_000  # bytes
_FEW = 6  # names that a sentence lists


def mapping_of(given: Mapping[str, str] | str | Path | None) -> dict[str, str]:
    """Return which column of a file is which of a motion.

    Args:
        given: the mapping, `theirs=ours,…`, or a TOML or JSON file of it; None for none.

    Raises:
        InputError: it is none of these.
        FileError: the file cannot be read.
    """
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return _checked(given, "columns")
    path, said = Path(given), str(given)
    if path.suffix.lower() in (".toml", ".json"):
        text = read_whole(path, what="The mapping of columns", largest=_LARGEST_MAPPING)
        read = tomllib.loads if path.suffix.lower() == ".toml" else json.loads
        try:
            return _checked(read(text.decode()), str(path))
        except (ValueError, RecursionError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path} cannot be read: {str(error)[:200]}.").at(path) from error
    pairs = [part.strip() for part in said.split(",")]
    wrong = next((part for part in pairs if part.count("=") != 1), None)
    if wrong is not None:
        raise InputError(
            f"columns has {wrong!r}; theirs=ours,theirs=ours is right, or a TOML or JSON file."
        )
    split = [(part.split("=")[0].strip(), part.split("=")[1].strip()) for part in pairs]
    if len({theirs for theirs, _ in split}) < len(split):
        raise InputError(f"columns {said!r} names a column of the file twice.")
    return _checked(dict(split), "columns")


def _checked(mapping: Any, where: str) -> dict[str, str]:
    if not isinstance(mapping, Mapping) or not all(
        isinstance(name, str) and name for pair in mapping.items() for name in pair
    ):
        raise InputError(f"{where} must map column names of the file to those of a motion.")
    twice = len(set(mapping.values())) < len(mapping)
    if twice:
        raise InputError(f"{where} maps two columns to one; each of a motion comes from one.")
    return dict(mapping)


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """The columns of a robot's motion.

    Attributes:
        robot: the robot.
        contacts: those of the design.
        mapping: what columns of the file are called here.
        path: how messages call the file.
        tell: called with a sentence on what is done with the file.
    """

    robot: Robot
    contacts: Sequence[Contact]
    mapping: Mapping[str, str]
    path: Path
    tell: Callable[[str], None]

    @property
    def base(self) -> tuple[str, ...]:
        """Columns of the base's pose; none if it is fixed."""
        return self.positions[: len(self.positions) - len(self.robot.joints)]

    @property
    def positions(self) -> tuple[str, ...]:
        """Columns of q."""
        robot = self.robot
        return Motion.position_columns(robot.joints, floating_base=robot.floating_base)

    @property
    def velocities(self) -> tuple[str, ...]:
        """Columns of v."""
        robot = self.robot
        return Motion.velocity_columns(robot.joints, floating_base=robot.floating_base)

    def choose(self, names: Sequence[str]) -> dict[str, str]:
        """Return which columns are read, and their names here; tell what is left out.

        Args:
            names: of the file's columns.

        Raises:
            MotionError: one is missing, two are one, or a contact is none of the design's.
        """
        absent = [name for name in self.mapping if name not in names]
        if absent:
            raise self._wrong(f"has no column {absent[0]!r}, which columns maps", absent[0], names)
        known = {*self.positions, *self.velocities, STIFFNESS}
        known |= {CONTACT + contact.frame for contact in self.contacts}
        found: dict[str, str] = {}
        times: list[str] = []
        left: list[str] = []
        for name in names:
            ours = self.mapping.get(name, name)
            if ours in known:
                found[name] = ours
            elif _TIME_NAME.fullmatch(ours):
                times.append(name)
            elif name in self.mapping:
                raise self._wrong(f"has no use for {ours!r}, to which columns maps {name!r}", ours)
            elif ours.startswith(CONTACT):
                frames = ", ".join(contact.frame for contact in self.contacts) or "none"
                raise MotionError(
                    f"{self.path}: the column {name} is of no contact of the design; it has "
                    f"{frames}."
                ).at(self.path, name)
            else:
                left.append(name)
        twice = next((ours for ours in found.values() if list(found.values()).count(ours) > 1), "")
        if twice:
            theirs = [name for name, ours in found.items() if ours == twice]
            raise MotionError(f"{self.path}: {' and '.join(theirs)} are both {twice}; map one.")
        time = self._time(times)
        self._require({*found.values()}, time, left)
        if left:
            shown = ", ".join(name or "one without a name" for name in left[:_FEW])
            more = f" and {len(left) - _FEW} more" if len(left) > _FEW else ""
            self.tell(
                f"{self.path}: {len(left)} column{'s are' if len(left) > 1 else ' is'} not read: "
                f"{shown}{more}"
            )
        return {str(time): self.mapping.get(str(time), str(time)), **found}

    def _time(self, times: list[str]) -> str | None:
        """The column of times: time_s if there is one."""
        ours = {self.mapping.get(name, name): name for name in times}
        if TIME in ours:
            return ours[TIME]
        if len(times) > 1:
            raise MotionError(
                f"{self.path}: {' and '.join(times)} are both times; say which by --columns "
                f"{times[0]}={TIME}, or its unit: time_ms, time_us, time_ns."
            )
        return times[0] if times else None

    def _require(self, found: set[str], time: str | None, left: Sequence[str]) -> None:
        """Refuse a table in which something is missing; the pose of a base may be as a whole."""
        needed = list(self.robot.joints)
        if found & set(self.base):
            needed = list(self.positions)
        missing = [name for name in needed if name not in found]
        if time is None:
            missing.insert(0, TIME)
        if missing:
            raise self._wrong(
                f"lacks the column {missing[0]} ({len(missing)} missing in all)", missing[0], left
            )

    def _wrong(self, problem: str, name: str, others: Sequence[str] = ()) -> MotionError:
        """An error that lists all columns there may be."""
        some = list(others)[:1000]
        close = difflib.get_close_matches(name, some, n=1)
        close = close or [other for other in some if name.lower() in other.lower()]
        hint = f"; is it {close[0]!r}? Then --columns {close[0]}={name}" if close else ""
        base = f"{', '.join(self.base)} (or none of these, then contacts give the base's pose), "
        contacts = ", ".join(CONTACT + contact.frame for contact in self.contacts)
        rates = (
            f"{', '.join(self.velocities)}" if self.robot.floating_base else f"<joint>{VELOCITY}"
        )
        return MotionError(
            f"{self.path} {problem}{hint}. A motion has {TIME} (or time_ms, time_us, time_ns), "
            f"{base if self.base else ''}{', '.join(self.robot.joints)}; it may have {rates}"
            f"{', ' if contacts else ''}{contacts}, {STIFFNESS}. --columns theirs=ours maps other "
            "names."
        ).at(self.path, name)

    def seconds(self, name: str, values: Array) -> Array:
        """Return times in s.

        Args:
            name: the column's name here.
            values: (N,) numbers; whole ones keep all of their digits.

        Raises:
            MotionError: the name says no unit, and rows are not as close as seconds are.
        """
        unit = _unit_of(name)
        with np.errstate(all="ignore"):
            relative = (values - values[:1]).astype(float)
            steps = np.diff(relative)
        step = float(np.median(steps)) if len(steps) else 0.0
        scale = _scale(unit) if unit else self._asked(name, step)
        if unit and scale == 1.0 and len(values) >= _LOG and _SLOW_ROWS <= step < np.inf:
            self.tell(
                f"{self.path}: rows are {step:g} s apart by {name}; if that is another unit, say "
                f"so by --columns {name}=time_{_likely(step)}"
            )
        if name != TIME and len(values) and float(values[0]) * scale > _EPOCH:
            return relative * scale
        return values.astype(float) * scale

    def _asked(self, name: str, step: float) -> float:
        """The unit of a time whose name says none: s, if rows are as close as that."""
        if not step >= _SLOW_ROWS:  # also a NaN, which its row is refused for
            if step:
                self.tell(f"{self.path}: {name} is taken as seconds; its rows are {step:g} apart")
            return 1.0
        raise MotionError(
            f"{self.path}: the column {name} does not say its unit, and its rows are {step:g} "
            f"apart: say it by --columns {name}=time_{_likely(step)}, or {TIME} if it is seconds."
        ).at(self.path, name)


def _unit_of(name: str) -> str | None:
    """The unit that a time's name says."""
    found = _TIME_NAME.fullmatch(name)
    return next((part for part in found.groups() if part), None) if found else None


def _scale(unit: str) -> float:
    """A unit in s."""
    return next(value for key, value in reversed(_UNITS.items()) if unit.lower().startswith(key))


def _likely(step: float) -> str:
    """The unit in which rows are closest to 100 a second, as logs are."""
    return _UNIT_NAMES[
        min(_UNIT_NAMES, key=lambda unit: abs(np.log(max(step, 1e-9) * unit / 0.01)))
    ]
