"""`sealag simulate`: run a scenario, write the recording, print the energy audit."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from sealag import design
from sealag.cli._commands import compile_kernels
from sealag.cli._json import show_json
from sealag.cli._pictures import check_picture, drawn, of_run, show_picture
from sealag.cli._terminal import show
from sealag.design import System
from sealag.errors import InputError
from sealag.files import Draft, check_output
from sealag.report import write_run
from sealag.simulation import MeasuredGait, Outcome, Run
from sealag.units import seconds_from_ms
from sealag.version import __version__

LONGEST_LOG_MS = 1e6

T = TypeVar("T")
Progress = Callable[[float], None]


def simulate_project(
    project: str,
    scenario: str | None,
    *,
    duration: float | None,
    seed: int | None,
    delay_scale: float,
    log_ms: float | None,
    out: Path | None,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Run a scenario with a progress bar, write the recording and show the audit.

    Returns:
        0 if the whole duration was simulated; 1 if the robot fell or the run ended otherwise.
    """
    system = design.load(project)
    path = out or Path(f"{system.name}.mcap")
    check_output(path, *system.files)
    check_picture(plot, *system.files, beside=path)
    length = system.duration(scenario) if duration is None else duration
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"--duration is {length}; a positive time in s is needed.")
    try:
        system.delays.scaled(delay_scale)
    except InputError as error:
        raise InputError(f"--delay-scale is {delay_scale:g}: {error}") from error
    if log_ms is not None and not 0.0 < log_ms <= LONGEST_LOG_MS:
        raise InputError(
            f"--log-ms is {log_ms:g}; it must be more than 0 and at most {LONGEST_LOG_MS:g}."
        )
    log_period = None if log_ms is None else seconds_from_ms(log_ms)
    with Draft(path) as draft:
        compile_kernels()
        run = _with_progress(
            "simulating",
            length,
            lambda progress: design.simulate(
                system,
                scenario=scenario,
                duration=length,
                seed=seed,
                delay_scale=delay_scale,
                log_period=log_period,
                progress=progress,
            ),
        )
        saved = _record(run, system, draft)
    if plot is not None:
        of_run(run, system.name).write(plot)
    answer = run.summary(recording=saved)
    kind = system.simulation.scenario if scenario is None else scenario
    if kind == "walk":
        answer |= gait_summary(system, run)
    if as_json:
        show_json({**answer, **drawn(plot)})
    else:
        _show(run, answer, kind)
        show_picture(plot)
    if run.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt
    return 0 if run.outcome is Outcome.COMPLETED else 1


def _record(run: Run, system: System, draft: Draft) -> Path:
    """Write the recording with a progress bar; Ctrl-C leaves the one before."""
    end = float(run.time[-1])
    if run.outcome is Outcome.INTERRUPTED:
        show(
            f"sealag: interrupted at {end:.3f} s; recording what was simulated (Ctrl-C again to "
            f"leave {draft.asked} as it is)",
            error=True,
        )
    try:
        saved = _with_progress(
            "recording",
            end,
            lambda progress: write_run(
                run,
                system.robot,
                draft,
                project=system.text,
                version=__version__,
                progress=progress,
            ),
        )
    except KeyboardInterrupt:
        show(f"sealag: nothing was recorded; {draft.asked} is as it was", error=True)
        raise
    if saved != draft.asked:
        show(f"sealag: recorded in {saved}; {draft.asked} is as it was", error=True)
    return saved


def _with_progress(name: str, length: float, call: Callable[[Progress | None], T]) -> T:
    """Call with a function that moves a progress bar on a terminal, or with None."""
    from rich import progress
    from rich.console import Console

    console = Console(file=sys.stderr)
    if not console.is_terminal:
        return call(None)
    with progress.Progress(console=console, transient=True) as bar:
        task = bar.add_task(name, total=length)
        return call(lambda t: bar.update(task, completed=t))


def gait_summary(system: System, run: Run) -> dict[str, Any]:
    """Return how a walk compares with its plan.

    Args:
        system: a design with a [walking] section.
        run: the run.
    """
    walking = system.walking
    assert walking is not None
    gait = MeasuredGait.of(system.robot, run, walking)
    return {
        "steps": gait.steps,
        "apex_speed_m_s": gait.apex_speed.tolist(),
        "step_width_m": gait.step_width.tolist(),
        "gait": gait.is_gait,
    }


def _show(run: Run, answer: dict[str, Any], scenario: str) -> None:
    books = run.audit
    show(f"{'outcome':26} {answer['outcome']}: {answer['message']}".rstrip(": "))
    show(f"{'simulated':26} {answer['duration_s']:.3f} s")
    show(f"{'measurement at most':26} {answer['measurement_age_s'] * 1e3:.2f} ms old")
    show(f"{'command at most':26} {answer['command_age_s'] * 1e3:.2f} ms old")
    show(f"{'both together at most':26} {answer['total_age_s'] * 1e3:.2f} ms old")
    for name, values in books.stores.items():
        show(f"{name + ' energy':26} {values[0]:.4f} J at first, {values[-1]:.4f} J at last")
    for name, works in books.joint_flows.items():
        label = f"{name.removesuffix('_work').replace('_', ' ')} work"
        show(f"{label:26} {float(works[-1].sum()):z.4f} J")
    show(
        f"{'first law':26} open by {answer['energy_residual_j']:.2e} J of "
        f"{answer['energy_throughput_j']:.4g} J moved"
    )
    if books.delay_injection is not None and books.law_injection is not None:
        within = f"within {answer['injection_error_j']:.1e} J"
        show(f"{'injected by the delay':26} {answer['delay_injection_j']:.4g} J at most, {within}")
        moved = abs(answer["law_injection_j"])
        show(f"{'injected by moving law':26} {moved:.4g} J at most, {within}")
    if books.delay_storage is not None:
        show(
            f"{'stored in the delay, V_4':26} {answer['delay_storage_j']:.4g} J at most, within "
            f"{answer['delay_storage_error_j']:.1e} J"
        )
    if books.tank is not None:
        show(f"{'energy tank':26} {books.tank[0]:.4f} J at first, {books.tank[-1]:.4f} J at last")
    sides = {
        "joint side": books.joint_side,
        "controller side": books.controller_side,
        "delay and damping": books.delay_side,
        "links, S_j at q̇_j": books.joint_port,
        "the rest, S_c at q̇_j": books.controller_port,
    }
    for name, side in sides.items():
        if side is not None:
            show(f"{name:26} {side.verdict}")
    if books.controller_side is None:
        why = "the reference moves" if scenario == "track" else "the law states no potential"
        show(f"{'controller side':26} not judged: {why}")
    if "steps" in answer:
        speeds = ", ".join(f"{v:.2f}" for v in answer["apex_speed_m_s"])
        widths = ", ".join(f"{w:.2f}" for w in answer["step_width_m"])
        show(f"{'steps':26} {answer['steps']}{'' if answer['gait'] else ', not a gait'}")
        show(f"{'apex speeds':26} {speeds} m/s")
        show(f"{'step widths':26} {widths} m")
    show(f"{'recording':26} {answer['recording']}")
