"""What every point is asked, and the columns of the answer."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from sealag.design import System, simulate
from sealag.errors import InputError, either, word
from sealag.passivity import Answer
from sealag.robot import Motion
from sealag.simulation import Outcome, Run
from sealag.tune import tune
from sealag.units import number_of

_TUNE = ("aim", "number", "share", "safety", "damping_ratio")
"""What `tune` can be told besides: words, then numbers."""
_TUNE_NUMBERS = ("safety", "damping_ratio")


ToDelays = Callable[[System], dict[str, Any]]


class Ask(StrEnum):
    """The command whose answer every point has; the bound is the part of `certify` that has a
    closed form."""

    CERTIFY = "certify"
    BOUND = "bound"
    MARGIN = "margin"
    TUNE = "tune"
    SIMULATE = "simulate"


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What every point is asked.

    Attributes:
        ask: the command.
        options: what else it is told; of `tune` only.
    """

    ask: Ask
    options: Mapping[str, Any]

    @classmethod
    def of(cls, text: str) -> "Question":
        """Read certify, bound, margin, simulate, tune, or tune:aim=damping,number=jitter.

        Args:
            text: the expression.

        Raises:
            InputError: it is none.
        """
        name, given, rest = text.partition(":")
        ask = word(Ask, name, what="--ask")
        if not given:
            return cls(ask=ask, options={})
        if ask is not Ask.TUNE:
            raise InputError(
                f"--ask is {text!r}; {ask} takes no options: give keys of the project a single "
                "value, such as --over simulation.duration_s=2."
            )
        options: dict[str, Any] = {}
        for part in rest.split(","):
            key, _, value = part.partition("=")
            number = number_of(value)
            if key not in _TUNE or not value or (key in _TUNE_NUMBERS and number is None):
                raise InputError(
                    f"--ask is {text!r}; tune takes {either(_TUNE)}, such as tune:aim=damping."
                )
            options[key] = number if key in _TUNE_NUMBERS else value
        return cls(ask=ask, options=options)

    def check(self, system: System) -> None:
        """Refuse a question that the project itself has no answer to.

        Args:
            system: the project's design.

        Raises:
            InputError: as the command would.
        """
        if self.ask in (Ask.CERTIFY, Ask.BOUND, Ask.TUNE):
            system.require_law("Bounds and tuned gains are")
        if self.ask is Ask.SIMULATE:
            system.duration()

    @property
    def columns(self) -> Mapping[str, type]:
        """Names and types of what is answered; each can be null."""
        return _COLUMNS[self.ask]

    @property
    def headline(self) -> str:
        """The column that a plot shows."""
        return _HEADLINES[self.ask]

    @property
    def verdict(self) -> str | None:
        """The column whose words are counted."""
        return _VERDICTS[self.ask]

    @property
    def of_motions(self) -> bool:
        """Whether it is asked along a motion."""
        return self.ask is not Ask.SIMULATE

    @property
    def spans_delays(self) -> bool:
        """Whether what is prepared for a law serves it with other delays too."""
        return self.ask in (Ask.CERTIFY, Ask.BOUND, Ask.MARGIN)

    def prepared(self, system: System, along: Motion | None) -> ToDelays:
        """Compute what an answer rests on besides the delays of both connections.

        Args:
            system: the design.
            along: a motion; None for the posture.

        Returns:
            A function of the design, or of one with other delays if the question `spans_delays`: an
            answer by column; a time that no delay reaches is inf, what is not known None.

        Raises:
            SealagError: the command would refuse it; so the function.
        """
        match self.ask:
            case Ask.CERTIFY:
                findings = system.findings(along)
                return lambda system: _certified(system, findings.confirmed(system.delays).answer)
            case Ask.BOUND:
                bound = _bound(system, along)
                return lambda system: _against(system.delays.d_1, bound)
            case Ask.MARGIN:
                found = _margin(system, along)
                return lambda _: found
            case Ask.TUNE:
                return lambda system: _tune(system, along, self.options)
            case Ask.SIMULATE:
                return _run


def _certified(system: System, answer: Answer) -> dict[str, Any]:
    return {
        "status": answer.status.value,
        "max_delay_s": answer.max_delay_s,
        "delay_s": system.delays.d_1,
        "local_margin_s": answer.local_margin_s,
        "first_crossing_s": answer.first_crossing_s,
        "stable": answer.stable,
        "unstable_modes": answer.unstable_modes,
        "limiting_joint": _largest(answer.worst.direction),
        "worst_instant": answer.worst.instant,
        "worst_time_s": answer.worst.time_s,
        "reasons": "; ".join(answer.reasons),
    }


def _bound(system: System, along: Motion | None) -> dict[str, Any]:
    motion = system.still() if along is None else along
    rest = system.rest(motion) if len(motion) == 1 else None
    found = system.certified_bounds(system.spaces(motion), rest, motion)
    worst = int(np.argmin(found.delay))
    shares = np.abs(found.worst_motion(worst)) ** 2
    return {
        "max_delay_s": float(found.delay[worst]),
        "limiting_joint": _largest(dict(zip(system.robot.joints, shares.tolist(), strict=True))),
        "worst_instant": worst,
        "worst_time_s": float(motion.time[worst]),
        "reasons": "; ".join(found.refusals),
    }


def _against(delay: float, bound: dict[str, Any]) -> dict[str, Any]:
    """A bound beside the design's delay, s."""
    return {**bound, "passive": 0.0 < bound["max_delay_s"] >= delay, "delay_s": delay}


def _margin(system: System, along: Motion | None) -> dict[str, Any]:
    found = system.local_margins(along)
    return {
        "passive_s": found.passive_s,
        "jitter_s": found.jitter_s,
        "delay_s": found.delay_s,
        "first_crossing_s": found.first_crossing_s,
        "frequency_rad_s": found.frequency_rad_s,
        "unstable_modes": found.unstable_modes,
        "limiting_joint": _largest(found.mode),
        "instant": found.instant,
        "time_s": found.time_s,
        "not_passive": found.not_passive,
    }


def _tune(system: System, along: Motion | None, options: Mapping[str, Any]) -> dict[str, Any]:
    tuned = tune(system, along, **options)
    binding = tuned.binding
    return {
        "found": tuned.found,
        "reached_s": tuned.reached_s,
        "required_s": tuned.question.required,
        "delay_s": tuned.question.system.delays.d_1,
        "scale": tuned.scale,
        "limit": tuned.limit,
        "bandwidth_rad_s": tuned.bandwidth_rad_s,
        "binding": None if binding is None else binding.kind,
        "limiting_joint": None if binding is None else binding.joint,
        "reasons": "; ".join(tuned.reasons),
    }


def _run(system: System) -> dict[str, Any]:
    run = simulate(system)
    if run.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt
    told = run.summary(recording=Path())
    known = {name: told[name] for name in _COLUMNS[Ask.SIMULATE] if name in told}
    return {**known, "fell": run.outcome is Outcome.FELL, "deviation_rms": _deviation(system, run)}


def _deviation(system: System, run: Run) -> float:
    """Root mean square of q − posture over joints and logged instants, rad or m."""
    n = len(run.joints)
    total = 0.0
    for rows in run.blocks():
        total += float(np.square(run.q[rows, -n:] - system.posture[-n:]).sum())
    return math.sqrt(total / (len(run.time) * n))


def _largest(shares: Mapping[str, float]) -> str | None:
    """The joint with the largest share; None where there is none."""
    return max(shares, key=lambda name: shares[name]) if shares else None


_COLUMNS: dict[Ask, dict[str, type]] = {
    Ask.CERTIFY: {
        "status": str,
        "max_delay_s": float,
        "delay_s": float,
        "local_margin_s": float,
        "first_crossing_s": float,
        "stable": bool,
        "unstable_modes": int,
        "limiting_joint": str,
        "worst_instant": int,
        "worst_time_s": float,
        "reasons": str,
    },
    Ask.BOUND: {
        "passive": bool,
        "max_delay_s": float,
        "delay_s": float,
        "limiting_joint": str,
        "worst_instant": int,
        "worst_time_s": float,
        "reasons": str,
    },
    Ask.MARGIN: {
        "passive_s": float,
        "jitter_s": float,
        "delay_s": float,
        "first_crossing_s": float,
        "frequency_rad_s": float,
        "unstable_modes": int,
        "limiting_joint": str,
        "instant": int,
        "time_s": float,
        "not_passive": str,
    },
    Ask.TUNE: {
        "found": bool,
        "reached_s": float,
        "required_s": float,
        "delay_s": float,
        "scale": float,
        "limit": float,
        "bandwidth_rad_s": float,
        "binding": str,
        "limiting_joint": str,
        "reasons": str,
    },
    Ask.SIMULATE: {
        "outcome": str,
        "fell": bool,
        "message": str,
        "duration_s": float,
        "deviation_rms": float,
        "energy_residual_j": float,
        "energy_throughput_j": float,
        "joint_side_passive": bool,
        "controller_side_passive": bool,
        "largest_joint_speed_rad_s": float,
        "largest_spring_torque_nm": float,
        "total_age_s": float,
    },
}

_HEADLINES = {
    Ask.CERTIFY: "max_delay_s",
    Ask.BOUND: "max_delay_s",
    Ask.MARGIN: "delay_s",
    Ask.TUNE: "limit",
    Ask.SIMULATE: "deviation_rms",
}

_VERDICTS = {
    Ask.CERTIFY: "status",
    Ask.BOUND: "passive",
    Ask.MARGIN: None,
    Ask.TUNE: "found",
    Ask.SIMULATE: "outcome",
}
