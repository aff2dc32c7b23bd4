"""Delays as functions of time."""

import math
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike
from sealag.units import check_delay_s, in_ms


class DelaySignal(Protocol):
    """A round-trip or one-way delay that may vary with time."""

    @property
    def upper_bound(self) -> float:
        """Return the largest delay that occurs, s."""
        ...

    @property
    def lower_bound(self) -> float:
        """Return the smallest delay that occurs, s."""
        ...

    @property
    def steepest_fall(self) -> float:
        """Return the largest rate at which the delay falls, s/s."""
        ...

    @property
    def mean(self) -> float:
        """Return the mean delay, s."""
        ...

    @property
    def left_out(self) -> float:
        """Return the share of packets that are later than the upper bound says."""
        ...

    def at(self, t: float | Array) -> Any:
        """Return the delay of what is sent at an instant.

        Args:
            t: the instant or instants, s.
        """
        ...


@dataclass(frozen=True, slots=True)
class Constant:
    """A delay that does not vary.

    Attributes:
        value: s.

    Raises:
        InputError: it is negative, not finite, or so long that a unit must be wrong.
    """

    value: float

    def __post_init__(self) -> None:
        """Check the value."""
        check_delay_s(self.value, "The constant delay")

    @property
    def upper_bound(self) -> float:
        """The value itself, s."""
        return self.value

    @property
    def lower_bound(self) -> float:
        """The value itself, s."""
        return self.value

    @property
    def steepest_fall(self) -> float:
        """0 s/s: it never falls."""
        return 0.0

    @property
    def mean(self) -> float:
        """The value itself, s."""
        return self.value

    @property
    def left_out(self) -> float:
        """0: no packet is later."""
        return 0.0

    def at(self, t: float | Array) -> float | Array:
        """Return the value, for each instant of t.

        Args:
            t: s.
        """
        return self.value if np.ndim(t) == 0 else np.full(np.shape(t), self.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sinusoid:
    """mean + amplitude · sin(angular_frequency · t + phase), as in the paper's simulations.

    Attributes:
        mean: s.
        amplitude: s, at most the mean.
        angular_frequency: rad/s.
        phase: rad.

    Raises:
        InputError: the delay would be negative somewhere, is not finite, or has a wrong unit.
    """

    mean: float
    amplitude: float
    angular_frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        check_delay_s(self.mean, "The sinusoid's mean delay")
        check_delay_s(self.amplitude, "The sinusoid's amplitude")
        check_delay_s(self.mean + self.amplitude, "The sinusoid's largest delay")
        if self.amplitude > self.mean:
            raise InputError(
                f"The sinusoid's amplitude {in_ms(self.amplitude)} exceeds its mean "
                f"{in_ms(self.mean)}, so that the delay would become negative."
            )
        if not (math.isfinite(self.angular_frequency) and math.isfinite(self.phase)):
            raise InputError("The sinusoid's angular frequency and phase must be finite.")

    @property
    def upper_bound(self) -> float:
        """The mean plus the amplitude, s."""
        return self.mean + self.amplitude

    @property
    def lower_bound(self) -> float:
        """The mean less the amplitude, s."""
        return self.mean - self.amplitude

    @property
    def steepest_fall(self) -> float:
        """Amplitude times angular frequency, s/s."""
        return self.amplitude * abs(self.angular_frequency)

    @property
    def left_out(self) -> float:
        """0: no packet is later."""
        return 0.0

    def at(self, t: float | Array) -> float | Array:
        """Return the delay.

        Args:
            t: s.
        """
        return self.mean + self.amplitude * np.sin(self.angular_frequency * t + self.phase)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A delay given at instants, linear between them and held outside.

    Attributes:
        time: (N,) s, increasing.
        delay: (N,) s.
        left_out: share of the packets that are later than the table says; 0 if none is.

    Raises:
        InputError: lengths differ, time does not increase, or a delay cannot be one.
    """

    time: Array
    delay: Array
    left_out: float = 0.0

    def __post_init__(self) -> None:
        """Check the arrays."""
        time, delay = np.asarray(self.time, float), np.asarray(self.delay, float)
        if time.ndim != 1 or time.shape != delay.shape or len(time) == 0:
            raise InputError("A delay table needs as many times as delays, at least one.")
        if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
            raise InputError("The times of a delay table must be finite and increase.")
        for value in delay:
            check_delay_s(float(value), "A delay of the table")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "delay", delay)

    @classmethod
    def measured(cls, samples: ArrayLike, *, period: float, quantile: float = 1.0) -> Self:
        """Make a delay signal from measured round-trip times.

        Args:
            samples: (N,) measured delays, s.
            period: time between them, s.
            quantile: samples above this quantile are cut to it; 1 keeps all. Below 1 the bound
                covers only that share of the samples.

        Returns:
            The samples as a table that starts at 0.

        Raises:
            InputError: there are no samples, one cannot be a delay, or period or quantile is wrong.
        """
        values = np.asarray(samples, dtype=float)
        if values.ndim != 1 or len(values) == 0:
            raise InputError("Measured delays need at least one sample.")
        if not (math.isfinite(period) and period > 0.0) or not 0.0 < quantile <= 1.0:
            raise InputError("Measured delays need a positive period and a quantile in (0, 1].")
        cut = float(np.quantile(values, quantile)) if quantile < 1.0 else np.inf
        return cls(
            time=np.arange(len(values)) * period,
            delay=np.minimum(values, cut),
            left_out=float(np.mean(values > cut)),
        )

    @property
    def upper_bound(self) -> float:
        """The largest entry, s."""
        return float(self.delay.max())

    @property
    def lower_bound(self) -> float:
        """The smallest entry, s."""
        return float(self.delay.min())

    @property
    def steepest_fall(self) -> float:
        """The steepest one between two neighbours, s/s."""
        slopes = np.diff(self.delay) / np.diff(self.time)
        return float(np.max(-slopes, initial=0.0))

    @property
    def mean(self) -> float:
        """The mean over the table's time, s."""
        if len(self.time) == 1:
            return float(self.delay[0])
        area = np.sum(0.5 * (self.delay[1:] + self.delay[:-1]) * np.diff(self.time))
        return float(area / (self.time[-1] - self.time[0]))

    def at(self, t: float | Array) -> float | Array:
        """Return the interpolated delay.

        Args:
            t: s.
        """
        value = np.interp(t, self.time, self.delay)
        return float(value) if np.ndim(t) == 0 else value


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A constant multiple of another delay signal.

    Attributes:
        signal: the whole delay.
        fraction: what multiple of it.

    Raises:
        InputError: the fraction is negative or not finite.
    """

    signal: DelaySignal
    fraction: float

    def __post_init__(self) -> None:
        """Check the fraction."""
        if not (math.isfinite(self.fraction) and self.fraction >= 0.0):
            raise InputError(
                f"A factor on a delay is {self.fraction}; 0 or a positive number is needed."
            )

    @property
    def upper_bound(self) -> float:
        """The multiple of the signal's upper bound, s."""
        return self.fraction * self.signal.upper_bound

    @property
    def lower_bound(self) -> float:
        """The multiple of the signal's lower bound, s."""
        return self.fraction * self.signal.lower_bound

    @property
    def steepest_fall(self) -> float:
        """The multiple of the signal's steepest fall, s/s."""
        return self.fraction * self.signal.steepest_fall

    @property
    def mean(self) -> float:
        """The multiple of the signal's mean, s."""
        return self.fraction * self.signal.mean

    @property
    def left_out(self) -> float:
        """The share that the signal leaves out."""
        return self.signal.left_out

    def at(self, t: float | Array) -> Any:
        """Return the multiple of the delay.

        Args:
            t: s.
        """
        return self.fraction * self.signal.at(t)
