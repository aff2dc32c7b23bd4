"""Pictures of the commands' answers: which curves, in which units."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sealag.cli._terminal import show
from sealag.errors import FileError, InputError
from sealag.files import check_output
from sealag.passivity import Certificate
from sealag.picture import Curve, Picture, ending_of
from sealag.simulation import Run
from sealag.typing import Array
from sealag.units import time_text

SHARES = tuple(np.geomspace(0.25, 4.0, 17).tolist())
"""Of the gains in tune's curve."""
_MOST_POINTS = 5000
"""Points of a curve of a run; more are below the width of a pixel."""


def check_picture(path: Path | None, *inputs: Path, beside: Path | None = None) -> None:
    """Refuse a picture that could not be drawn, before anything is computed.

    Args:
        path: the picture; None for none.
        inputs: files that the command reads.
        beside: what else the command writes; None for nothing.

    Raises:
        InputError: its ending is none of a picture's.
        FileError: it is an input or what else is written, or no file can have the name.
    """
    if path is not None:
        ending_of(path)
        check_output(path, *inputs)
        if beside is not None and os.path.realpath(path) == os.path.realpath(beside):
            raise FileError(
                f"{path} is asked for twice, as picture and as the command's own output; choose "
                "another name for --plot."
            )


def drawn(path: Path | None) -> dict[str, str]:
    """Return what JSON says of the picture: nothing if none was asked for.

    Args:
        path: the picture.
    """
    return {} if path is None else {"plot": str(path)}


def show_picture(path: Path | None) -> None:
    """Say where the picture is.

    Args:
        path: the picture; None for none.
    """
    if path is not None:
        show(f"{'plot':26} {path}")


def require_motion(path: Path | None, instants: int) -> None:
    """Refuse the picture of a single instant.

    Args:
        path: the picture; None for none.
        instants: of the motion.
    """
    if path is not None and instants < 2:
        raise InputError(
            "--plot of a certificate shows bounds along a motion; give one (--motion), or ask "
            "sweep or margin --horizon-ms for a curve of the posture."
        )


def of_certificate(certificate: Certificate, name: str) -> Picture:
    """Return bounds and margins of every instant.

    Args:
        certificate: of a motion.
        name: of the design.
    """
    evidence, answer = certificate.evidence, certificate.answer
    margins = np.array(
        [np.nan if one is None else one for one in evidence.instant_margins_s], dtype=float
    )
    levels = {
        "delay of the design": certificate.question.delay_s,
        "one multiplier for all": answer.common_multiplier_delay_s,
        "time-varying matrices": answer.time_varying_delay_s,
    }
    return Picture(
        title=f"{name}: delay that each instant tolerates",
        x="time (s)",
        y="delay (ms)",
        curves=(
            Curve(name="passive bound", x=evidence.time_s, y=_ms(evidence.bounds_s)),
            Curve(name="local margin", x=evidence.time_s, y=_ms(margins)),
        ),
        levels={key: value * 1e3 for key, value in levels.items() if value is not None},
    )


def of_margins(found: Any, name: str) -> Picture:
    """Return how many roots are unstable at each delay up to the horizon.

    Args:
        found: margins with their ranges of delay.
        name: of the design.
    """
    ends = [one[0] for one in found.intervals] + [found.intervals[-1][1]]
    counts = [one[2] for one in found.intervals] + [found.intervals[-1][2]]
    marks = {
        "passive bound": found.passive_s,
        "jitter margin": found.jitter_s,
        "local margin": found.delay_s,
    }
    return Picture(
        title=f"{name}: unstable roots against delay",
        x="constant delay (ms)",
        y="unstable roots (1)",
        curves=(Curve(name="", x=_ms(ends), y=np.array(counts, dtype=float), steps=True),),
        marks={key: value * 1e3 for key, value in marks.items() if value},
    )


def of_rates(rates: Sequence[Any], name: str) -> Picture:
    """Return what each sample rate tolerates.

    Args:
        rates: of the sweep.
        name: of the design.
    """
    x = np.array([rate.rate_hz for rate in rates])
    largest = [np.nan if rate.largest_s is None else rate.largest_s for rate in rates]
    return Picture(
        title=f"{name}: delay that each sample rate tolerates",
        x="sample rate (Hz)",
        y="delay beside the hold (ms)",
        curves=(
            Curve(name="largest stable", x=x, y=_ms(largest)),
            Curve(name="proven", x=x, y=_ms([rate.proven_s for rate in rates])),
            Curve(name="the design's", x=x, y=_ms([rate.way_s for rate in rates])),
        ),
        logarithmic=True,
    )


def of_gains(tuned: Any) -> Picture:
    """Return what gains around those that were found tolerate, or the front.

    Args:
        tuned: the answer.
    """
    if tuned.front:
        return _of_front(tuned)
    if tuned.schedule is not None:
        return _of_schedule(tuned)
    asked = tuned.question
    return Picture(
        title=f"{tuned.system.name}: delay that gains tolerate ({asked.aim}, {asked.number})",
        x="gains over those found (1)",
        y="delay (ms)",
        curves=(Curve(name="", x=np.array(SHARES), y=_ms(tuned.tolerated(SHARES))),),
        levels={"required": asked.required * 1e3},
        marks={"found": 1.0},
        logarithmic=True,
    )


def _of_schedule(tuned: Any) -> Picture:
    """The factor of the gains along the motion."""
    motion = tuned.schedule
    return Picture(
        title=f"{tuned.system.name}: scheduled stiffness",
        x="time (s)",
        y="factor of all stiffness (1)",
        curves=(Curve(name="", x=motion.time, y=motion.stiffness),),
    )


def _of_front(tuned: Any) -> Picture:
    """Stiffness against the cost of damping, a curve for each delay, bandwidth as grey."""
    points, moves = tuned.front, tuned.question.moves
    curves = []
    for delay in sorted({point.delay_s for point in points}):
        own = sorted((p for p in points if p.delay_s == delay), key=lambda point: point.cost)
        curves.append(
            Curve(
                name=time_text(delay),
                x=np.array([point.cost for point in own]),
                y=np.array([point.scale for point in own]),
                labels=tuple(str(point.number) for point in own),
                shades=np.array([point.bandwidth_hz for point in own]),
            )
        )
    return Picture(
        title=f"{tuned.system.name}: designs that no other one beats, by delay",
        x="drag along the motion (J)" if moves else "trace of the damping (Nms/rad)",
        y="factor of all stiffness (1)",
        curves=tuple(curves),
        shade="bandwidth of the slowest locked joint (Hz)",
        logarithmic=True,
    )


def of_run(run: Run, name: str) -> Picture:
    """Return the energies of a run's audit.

    Args:
        run: the run.
        name: of the design.
    """
    books = run.audit
    rows = slice(None, None, -(-len(run.time) // _MOST_POINTS))
    energy = np.sum([values[rows] for values in books.stores.values()], axis=0)
    shown = {
        "stored in the robot, less at first": energy - energy[0],
        "given by the command": books.joint_flows["command"][rows].sum(axis=1),
        "taken by motor damping": books.joint_flows["damping"][rows].sum(axis=1),
        "injected by the delay": books.delay_injection,
        "injected by the moving law": books.law_injection,
        "left to the controller side": None,
    }
    if books.controller_side is not None:
        shown["left to the controller side"] = books.controller_side.slack
    curves = [
        Curve(name=key, x=run.time[rows], y=values if len(values) == len(energy) else values[rows])
        for key, values in shown.items()
        if values is not None
    ]
    return Picture(
        title=f"{name}: energy audit", x="time (s)", y="energy (J)", curves=tuple(curves)
    )


def _ms(seconds: Sequence[float] | Array) -> Array:
    return np.asarray(seconds, dtype=float) * 1e3
