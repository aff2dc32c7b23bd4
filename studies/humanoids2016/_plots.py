"""Plots as SVG markup for pages."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from humanoids2016._beyond import DelayMap
from humanoids2016._figure4 import Figure4
from humanoids2016._figure5 import TorqueTrace
from humanoids2016._levels import LevelTable
from humanoids2016._walk import Walk
from sealag.whole_body import MotorAngles, StaticJoint, StiffnessForm

COLOURS = ("#0b6e99", "#c0561f", "#5b7f2b")


@contextmanager
def _drawing(width: float, height: float, *, rows: int = 1) -> Iterator[tuple[Any, Any]]:
    """A figure and its axes that leave nothing behind; text stays text."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(
        {"svg.fonttype": "none", "font.size": 12, "axes.spines.top": False,
         "axes.spines.right": False, "font.family": "sans-serif"}
    ):  # fmt: skip
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, figure.subplots(rows, sharex=True)


def _svg(figure: Any) -> str:
    """Markup of a figure that scales with its place on the page."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def plot_figure_4(figure: Figure4) -> str:
    """Draw the largest delay against α.

    Args:
        figure: the computed figure.

    Returns:
        SVG markup.
    """
    with _drawing(7.2, 4.6) as (drawing, axes):
        for colour, damping, delay in zip(
            COLOURS, figure.abduction_damping, figure.delay_s, strict=True
        ):
            axes.plot(
                figure.alpha, delay * 1e3, "-o", ms=3.5, color=colour,
                label=f"(29), D_θ[0] = {damping:g} Nms/rad",
            )  # fmt: skip
        name, certified = _certified(figure)
        axes.plot(
            figure.alpha, figure.alpha * certified * 1e3, "--", color="#777",
            label=f"certified, {name} fed back, D_θ[0] = 10",
        )  # fmt: skip
        axes.set_xlabel("α, factor on the motor damping D_θ")
        axes.set_ylabel("largest delay over the walk (ms)")
        axes.set_ylim(bottom=0.0)
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.25)
        axes.legend(frameon=False, fontsize=10)
        return _svg(drawing)


def _certified(figure: Figure4) -> tuple[str, float]:
    """The smallest certified bound with q̄(θ) fed back, or with θ where q̄(θ) does not exist."""
    least = {
        v.signal: float(v.delay_s.min())
        for v in reversed(figure.certified)
        if v.form is StiffnessForm.SYMMETRIC and not v.reason
    }
    name = StaticJoint.name if StaticJoint.name in least else MotorAngles.name
    return ("q̄(θ)" if name == StaticJoint.name else "θ"), least.get(name, 0.0)


def plot_walk_bounds(figure: Figure4) -> str:
    """Draw the bound at every instant of the walk for α = 1.

    Args:
        figure: the computed figure.

    Returns:
        SVG markup.
    """
    with _drawing(7.2, 4.0) as (drawing, axes):
        pick = np.unique(np.linspace(0, len(figure.time) - 1, 900).astype(int))
        for colour, damping, delay in zip(
            COLOURS, figure.abduction_damping, figure.instants_delay_s, strict=True
        ):
            label = f"(29), D_θ[0] = {damping:g}"
            axes.plot(figure.time[pick], delay[pick] * 1e3, color=colour, lw=1.4, label=label)
        static = next(
            v.delay_s
            for v in figure.certified
            if v.signal == StaticJoint.name and v.form is StiffnessForm.SYMMETRIC
        )
        axes.plot(
            figure.time[pick], static[pick] * 1e3, "--", color="#777", lw=1.2,
            label="certified, q̄(θ), D_θ[0] = 10",
        )  # fmt: skip
        axes.set_xlabel("time along the planned walk (s)")
        axes.set_ylabel("largest delay (ms)")
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.25)
        axes.legend(frameon=False, fontsize=10, ncols=2)
        return _svg(drawing)


def plot_levels(levels: LevelTable) -> str:
    """Draw the bounds of both orders of two levels over the bound of one level.

    Args:
        levels: bounds along a walk.

    Returns:
        SVG markup.
    """
    with _drawing(7.2, 3.4) as (drawing, axes):
        for colour, mark, one in zip(COLOURS, ("-o", "--s"), levels.levels, strict=False):
            axes.plot(
                levels.time, one.delay_s / levels.single, mark, ms=3.0, color=colour, lw=1.0,
                label=one.name,
            )  # fmt: skip
        axes.axhline(1.0, color="#000", lw=0.8)
        axes.set_xlabel("time along the planned walk (s)")
        axes.set_ylabel("two levels / one level")
        axes.grid(alpha=0.25)
        drawing.legend(frameon=False, fontsize=10, ncols=2, loc="outside upper center")
        return _svg(drawing)


def plot_gait(walk: Walk) -> str:
    """Draw apex speeds and step widths of a walk against its plan.

    Args:
        walk: the walk.

    Returns:
        SVG markup.
    """
    gait, plan = walk.gait, walk.case.walking.gait
    with _drawing(7.2, 3.6) as (drawing, axes):
        widths = np.arange(1, gait.steps + 1)
        for colour, x, y, planned, share, label in (
            (COLOURS[0], gait.apex_step, gait.apex_speed, plan.apex_speed, 0.2, "apex speed (m/s)"),
            (COLOURS[1], widths, gait.step_width, plan.step_width, 0.25, "step width (m)"),
        ):
            axes.plot(x, y, "o-", color=colour, label=label)
            axes.axhline(planned, ls="--", color=colour, lw=1)
            low, high = planned * (1 - share), planned * (1 + share)
            axes.axhspan(low, high, color=colour, alpha=0.1, lw=0)
        axes.set_xlabel("step")
        axes.set_ylim(0.0, 1.4 * plan.apex_speed)
        axes.legend(frameon=False, ncols=2, fontsize=10)
        return _svg(drawing)


def plot_torques(traces: Sequence[TorqueTrace], joints: Sequence[int]) -> str:
    """Draw command and spring torque of some joints for the smallest and largest β.

    Args:
        traces: walks with several β.
        joints: their places, one panel each.

    Returns:
        SVG markup.
    """
    with _drawing(7.2, 2.4 * len(joints), rows=len(joints)) as (drawing, panels):
        names = traces[0].walk.run.joints
        for axes, joint in zip(np.atleast_1d(panels), joints, strict=True):
            for colour, trace in zip(COLOURS, (traces[0], traces[-1]), strict=False):
                time = trace.walk.run.time
                pick = slice(0, None, max(1, len(time) // 900))
                axes.plot(time[pick], trace.command[pick, joint], color=colour, lw=0.7)
                axes.plot(
                    time[pick], trace.achieved[pick, joint], color=colour, lw=2.0, alpha=0.6,
                    label=f"β = {trace.beta:g}",
                )  # fmt: skip
            axes.set_ylabel(f"{names[joint]} (Nm)")
            limit = 1.4 * max(float(np.abs(t.achieved[:, joint]).max()) for t in traces)
            axes.set_ylim(-limit, limit)
            axes.grid(alpha=0.25)
        axes.set_xlabel("time (s)")
        np.atleast_1d(panels)[0].legend(frameon=False, fontsize=10, ncols=2)
        return _svg(drawing)


LAG_WINDOW = (1.0, 2.2)
"""Part of the walk in which the lag is shown, s."""


def plot_lag(traces: Sequence[TorqueTrace], joint: int) -> str:
    """Draw a joint's command as it is sent and its spring torque, one panel for each β.

    Args:
        traces: walks with several β.
        joint: its place.

    Returns:
        SVG markup.
    """
    with _drawing(7.2, 2.1 * len(traces), rows=len(traces)) as (drawing, panels):
        for axes, trace in zip(np.atleast_1d(panels), traces, strict=True):
            time = trace.walk.run.time
            pick = (time >= LAG_WINDOW[0]) & (time <= LAG_WINDOW[1])
            axes.plot(time[pick], trace.sent[pick, joint], color="#000", lw=0.9, label="Γ_osc")
            axes.plot(
                time[pick], trace.achieved[pick, joint], color=COLOURS[1], lw=2.0, alpha=0.8,
                label="Γ_sea",
            )  # fmt: skip
            axes.set_ylabel(f"β = {trace.beta:g} (Nm)")
            axes.grid(alpha=0.25)
        axes = np.atleast_1d(panels)
        axes[-1].set_xlabel("time (s)")
        axes[0].legend(frameon=False, fontsize=10, ncols=2)
        return _svg(drawing)


def plot_delay_map(delays: DelayMap) -> str:
    """Draw what was walked over spring stiffness and delay, with the bounds as lines.

    Args:
        delays: the map.

    Returns:
        SVG markup.
    """
    with _drawing(7.2, 4.4) as (drawing, axes):
        K, d = (grid.T for grid in np.meshgrid(delays.stiffness, delays.d_1 * 1e3))
        gait = delays.gaits == delays.terrains
        walked = (delays.walked == delays.terrains) & ~gait
        fell = ~gait & ~walked
        for mark, face, chosen, label in (
            ("o", COLOURS[2], gait, "walked, a gait"),
            ("o", "none", walked, "walked"),
            ("x", "#a33", fell, "fell"),
        ):
            colour = "#a33" if mark == "x" else COLOURS[2]
            style = {"edgecolors": colour, "facecolors": face} if mark == "o" else {"color": colour}
            axes.scatter(K[chosen], d[chosen], s=46, marker=mark, label=label, **style)
        for values, style, colour, label in (
            (delays.certified_motor, "-", COLOURS[0], "certified, motor angles"),
            (delays.certified_static, "--", COLOURS[0], "certified, q̄(θ)"),
            (delays.first_crossing, ":", "#444", "next roots cross (exact)"),
        ):
            axes.plot(delays.stiffness, values * 1e3, style, color=colour, label=label)
        axes.set_xscale("log")
        axes.set_xticks(delays.stiffness, [f"{value:g}" for value in delays.stiffness])
        axes.minorticks_off()
        axes.set_xlabel("spring stiffness K (Nm/rad)")
        axes.set_ylabel("largest delay d_1 (ms)")
        axes.set_ylim(0.0, 1.05e3 * float(delays.d_1[-1]))
        drawing.legend(frameon=False, fontsize=9, ncols=3, loc="outside upper center")
        return _svg(drawing)
