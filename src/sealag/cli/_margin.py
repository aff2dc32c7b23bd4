"""`sealag margin`: the exact local margin, what sample rates tolerate, the gait's own margin."""

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

from sealag import design
from sealag.cli._commands import busy, compile_kernels, note
from sealag.cli._json import show_json
from sealag.cli._pictures import check_picture, drawn, of_margins, of_rates, show_picture
from sealag.cli._terminal import show
from sealag.errors import InputError
from sealag.units import seconds_from_ms, time_text

LONGEST_HORIZON_MS = 1e6

_JITTERS = {
    "positions": "only positions vary",
    "rates": "only rates vary",
    "command": "only the command varies",
    "all": "each varies by itself",
}
"""Channels of a jitter margin; both ways at once are the margin itself."""


class Instead(StrEnum):
    """What is asked for instead of the margin of the frozen loop, and of what it is."""

    RATES = "--rate-sweep is of the project's posture"
    GAIT = "--gait is of the project's [walking] section"


def asked_instead(*, rate_sweep: bool, gait: bool) -> Instead | None:
    """Return what two options ask for.

    Args:
        rate_sweep: whether sample rates.
        gait: whether the gait's margin.

    Raises:
        InputError: both are asked for.
    """
    if rate_sweep and gait:
        raise InputError("--rate-sweep and --gait are two questions: leave one out.")
    if rate_sweep:
        return Instead.RATES
    return Instead.GAIT if gait else None


def margin_project(
    project: str,
    motion: Path | None,
    *,
    columns: str | None,
    quaternion: str | None,
    horizon_ms: float | None,
    instead: Instead | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Show the exact local margin at every instant, or at a sample of a long motion."""
    if instead is not None:
        if any(given is not None for given in (motion, columns, quaternion, horizon_ms)):
            raise InputError(f"{instead.value}: leave out the others.")
        show_other = _sweep_rates if instead is Instead.RATES else _gait_margin
        show_other(project, plot=plot, as_json=as_json)
        return
    if plot is not None and horizon_ms is None:
        raise InputError(
            "--plot of a margin shows unstable roots against delay, or what sample rates tolerate; "
            "give --horizon-ms or --rate-sweep."
        )
    if horizon_ms is not None and not 0.0 < horizon_ms <= LONGEST_HORIZON_MS:
        raise InputError(
            f"--horizon-ms is {horizon_ms:g}; it must be more than 0 and at most "
            f"{LONGEST_HORIZON_MS:g}."
        )
    system = design.load(project)
    horizon = None if horizon_ms is None else seconds_from_ms(horizon_ms)
    check_picture(plot, *system.files, *([motion] if motion else []))
    along = system.motion_of(motion, columns=columns, quaternion=quaternion, tell=note)
    compile_kernels()
    with busy("computing margins", along):
        found = system.local_margins(along, horizon=horizon)
    if plot is not None:
        of_margins(found, system.name).write(plot)
    answer: dict[str, Any] = found.summary()
    if as_json:
        show_json({**answer, **drawn(plot)})
        return
    covers = "any passive robot and environment, every delay below it"
    passive = f"{time_text(found.passive_s):12} {covers}"
    if found.not_passive:
        passive = f"none: {found.not_passive}"
    show(f"{'passive bound':26} {passive}")
    varies = "both ways vary, every delay below it" if found.memory else "every delay below it"
    show(f"{'jitter margin':26} {time_text(found.jitter_s):12} this robot, {varies}")
    for name, value in found.jitter_channels_s.items():
        if name in _JITTERS:
            show(f"{f'  {_JITTERS[name]}':26} {time_text(value)}")
    show(f"{'local margin':26} {time_text(found.delay_s):12} this robot, a constant delay: exact")
    for name, value in found.channels_s.items():
        show(f"{f'  only {name} late':26} {time_text(value)}")
    if system.program is not None:
        states = f"{found.memory} states" if found.memory else "no memory"
        show(f"{'controller':26} {states}; nonlinear by {max(found.bend, 1e-6):.1g} of its answers")
    show(f"{'delay of the design':26} {time_text(system.delays.d_1)}")
    show(f"{'first crossing':26} {time_text(found.first_crossing_s)}")
    if found.frequency_rad_s is not None:
        show(f"{'frequency':26} {found.frequency_rad_s:.3f} rad/s")
    show(f"{'unstable roots':26} {found.unstable_modes} without delay")
    if found.falling:
        show(f"{'  grows without delay':26} {_largest(found.falling)}")
    show(f"{'zero roots of symmetries':26} {found.neutral}")
    show(f"{'instant':26} {found.instant} of {found.instants}, at {found.time_s:.3f} s")
    show(f"{'mode of first crossing':26} {_largest(found.mode)}")
    for low, high, count in found.intervals:
        show(f"{time_text(low):>14} to {time_text(high):14} {count} unstable roots")
    show_picture(plot)


def _largest(shares: Mapping[str, float]) -> str:
    """The three joints that take the largest part in a motion."""
    largest = sorted(shares.items(), key=lambda item: -item[1])[:3]
    return ", ".join(f"{name} {share:.0%}" for name, share in largest)


def _sweep_rates(project: str, *, plot: Path | None, as_json: bool) -> None:
    """Show what each sample rate tolerates."""
    system = design.load(project)
    check_picture(plot, *system.files)
    compile_kernels()
    with busy("sampling the loop at each rate"):
        rates = system.rate_sweep()
    if plot is not None:
        of_rates(rates, system.name).write(plot)
    if as_json:
        show_json({"rates": [rate.summary() for rate in rates], **drawn(plot)})
        return
    show("rate          largest delay   proven          the design's, without the hold")
    for rate in rates:
        # too many commands wait for the exact loop: only the proven delay is known
        largest = "not found" if rate.largest_s is None else time_text(rate.largest_s)
        verdict = {True: "stable", False: "unstable", None: "open"}[rate.stable]
        show(
            f"{rate.rate_hz:7.1f} Hz    {largest:15} {time_text(rate.proven_s):15} "
            f"{time_text(rate.way_s)}, {verdict}"
        )
    lost = [f"{rate.rate_hz:g}" for rate in rates if rate.stable is False]
    kept = [f"{rate.rate_hz:g}" for rate in rates if rate.stable]
    parts = ((lost, "unstable"), (kept, "stable"))
    show("; ".join(f"{', '.join(some)} Hz: {word}" for some, word in parts if some))
    show_picture(plot)


def _gait_margin(project: str, *, plot: Path | None, as_json: bool) -> None:
    """Show up to which delay the gait is stable, and its simulation walks."""
    if plot is not None:
        raise InputError("--plot draws no --gait: leave one out.")
    system = design.load(project)
    system.required_walking()
    compile_kernels()
    with busy("walking under longer and longer delays"):
        found = system.gait_margin()
    if as_json:
        show_json(found.summary())
        return
    show("delay         largest multiplier   gait       simulated walk")
    for point in found.points:
        radius = f"{point.radius:.3f}" if math.isfinite(point.radius) else "no gait"
        gait, walk = (
            "stable" if point.stable else "not stable",
            "goes on" if point.walks else "falls",
        )
        show(
            f"{time_text(point.delay_s):13} {radius:20} {gait:10} {walk:8} {point.reason}".rstrip()
        )
    falls = time_text(found.falls_s) if math.isfinite(found.falls_s) else "none that was tried"
    show(f"{'margin of the gait':26} {time_text(found.delay_s)}   constant delay, level ground")
    show(f"{'simulated walk goes on to':26} {time_text(found.walks_s)}, falls at {falls}")
    show(f"{'mean delay of the design':26} {time_text(found.design_s)}")
    show(f"{'multipliers of 1':26} {found.neutral} translations, taken out")
