"""`sealag simulate`: run, record, and account for the energy."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import sealag
from sealag.cli._app import show_json
from sealag.cli._commands import compile_kernels
from sealag.design import System, load, resolve_project, scenario_duration, simulate
from sealag.errors import InputError
from sealag.files import check_output
from sealag.report import write_run
from sealag.simulation import Outcome, Passivity, Run, measure_gait
from sealag.typing import Array

T = TypeVar("T")
Progress = Callable[[float], None]


def simulate_project(
    project: str,
    scenario: str | None,
    *,
    duration: float | None,
    seed: int | None,
    delay_scale: float,
    out: Path | None,
    as_json: bool,
) -> None:
    """Run a scenario with a progress bar, write the recording and show the audit."""
    path = out or Path(f"{resolve_project(project).stem}.mcap")
    system = load(project)
    check_output(path, *system.files)
    length = scenario_duration(system, scenario) if duration is None else duration
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"--duration is {length}; a positive time in s is needed.")
    try:
        system.delays.scaled(delay_scale)
    except InputError as error:
        raise InputError(f"--delay-scale is {delay_scale:g}: {error}") from error
    compile_kernels()
    run = _with_progress(
        "simulating",
        length,
        lambda progress: simulate(
            system,
            scenario=scenario,
            duration=length,
            seed=seed,
            delay_scale=delay_scale,
            progress=progress,
        ),
    )
    _record(run, system, path)
    answer = summary(run, path)
    if (system.simulation.scenario if scenario is None else scenario) == "walk":
        answer |= gait_summary(system, run)
    if as_json:
        show_json(answer)
    else:
        _show(run, answer)
    if run.outcome is Outcome.INTERRUPTED:
        raise KeyboardInterrupt


def _record(run: Run, system: System, path: Path) -> None:
    """Write the recording with a progress bar; Ctrl-C leaves the one before."""
    end = float(run.time[-1])
    if run.outcome is Outcome.INTERRUPTED:
        print(
            f"sealag: interrupted at {end:.3f} s; recording what was simulated (Ctrl-C again to "
            f"leave {path} as it is)",
            file=sys.stderr,
        )
    try:
        _with_progress(
            "recording",
            end,
            lambda progress: write_run(
                run,
                system.robot,
                path,
                project=system.text,
                version=sealag.__version__,
                progress=progress,
            ),
        )
    except KeyboardInterrupt:
        print(f"sealag: nothing was recorded; {path} is as it was", file=sys.stderr)
        raise


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


def summary(run: Run, path: Path) -> dict[str, Any]:
    """Return what a run's JSON answer holds.

    Args:
        run: the run.
        path: its recording.
    """
    books = run.audit
    joint, central, delay = books.joint_side, books.controller_side, books.delay_side
    return {
        "outcome": run.outcome.value,
        "message": run.message,
        "duration_s": float(run.time[-1]),
        "seed": run.seed,
        "recording": str(path),
        "largest_joint_speed_rad_s": float(np.abs(run.theta_dot).max()),
        "largest_spring_torque_nm": float(np.abs(run.tau_sea).max()),
        "measurement_age_s": run.ages.measurement,
        "command_age_s": run.ages.command,
        "total_age_s": run.ages.total,
        "energy_residual_j": float(np.abs(books.residual).max()),
        "energy_throughput_j": float(books.throughput[-1]),
        "joint_side_passive": joint.passive,
        "controller_side_passive": central.passive if central else None,
        "controller_side_slack_j": float(central.slack.min()) if central else None,
        "first_violation_s": central.first_violation if central else None,
        "violating_joint": central.joint if central else None,
        "delay_side_passive": delay.passive if delay else None,
        "delay_side_slack_j": float(delay.slack.min()) if delay else None,
        "delay_injection_j": _largest(books.delay_injection),
        "law_injection_j": _largest_magnitude(books.law_injection),
        "injection_error_j": books.injection_error,
        "delay_storage_j": _largest(books.delay_storage),
        "delay_storage_error_j": books.delay_storage_error,
        "tank_j": float(books.tank[-1]) if books.tank is not None else None,
        "touchdowns": sum(event.kind.value == "touchdown" for event in run.events),
    }


def _largest(values: Array | None) -> float | None:
    return None if values is None else float(values.max())


def _largest_magnitude(values: Array | None) -> float | None:
    """The value that is furthest from 0, with its sign."""
    return None if values is None else float(values[np.abs(values).argmax()])


def gait_summary(system: System, run: Run) -> dict[str, Any]:
    """Return how a walk compares with its plan.

    Args:
        system: a design with a [walking] section.
        run: the run.
    """
    walking = system.walking
    assert walking is not None
    gait = measure_gait(system.robot, run, walking)
    return {
        "steps": gait.steps,
        "apex_speed_m_s": gait.apex_speed.tolist(),
        "step_width_m": gait.step_width.tolist(),
        "gait": gait.is_gait,
    }


def _show(run: Run, answer: dict[str, Any]) -> None:
    books = run.audit
    print(f"{'outcome':26} {answer['outcome']} {answer['message']}".rstrip())
    print(f"{'simulated':26} {answer['duration_s']:.3f} s")
    print(f"{'measurement at most':26} {answer['measurement_age_s'] * 1e3:.2f} ms old")
    print(f"{'command at most':26} {answer['command_age_s'] * 1e3:.2f} ms old")
    print(f"{'both together at most':26} {answer['total_age_s'] * 1e3:.2f} ms old")
    for name, values in books.stores.items():
        print(f"{name + ' energy':26} {values[0]:.4f} J at first, {values[-1]:.4f} J at last")
    for name, works in books.joint_flows.items():
        label = f"{name.removesuffix('_work').replace('_', ' ')} work"
        print(f"{label:26} {float(works[-1].sum()):.4f} J")
    print(
        f"{'first law':26} open by {answer['energy_residual_j']:.2e} J of "
        f"{answer['energy_throughput_j']:.4g} J moved"
    )
    if books.delay_injection is not None and books.law_injection is not None:
        within = f"within {answer['injection_error_j']:.1e} J"
        print(f"{'injected by the delay':26} {answer['delay_injection_j']:.4g} J at most, {within}")
        moved = abs(answer["law_injection_j"])
        print(f"{'injected by moving law':26} {moved:.4g} J at most, {within}")
    if books.delay_storage is not None:
        print(
            f"{'stored in the delay, V_4':26} {answer['delay_storage_j']:.4g} J at most, within "
            f"{answer['delay_storage_error_j']:.1e} J"
        )
    if books.tank is not None:
        print(f"{'energy tank':26} {books.tank[0]:.4f} J at first, {books.tank[-1]:.4f} J at last")
    _show_side("joint side", books.joint_side)
    _show_side("controller side", books.controller_side)
    _show_side("delay and damping", books.delay_side)
    if "steps" in answer:
        speeds = ", ".join(f"{v:.2f}" for v in answer["apex_speed_m_s"])
        widths = ", ".join(f"{w:.2f}" for w in answer["step_width_m"])
        print(f"{'steps':26} {answer['steps']}{'' if answer['gait'] else ', not a gait'}")
        print(f"{'apex speeds':26} {speeds} m/s")
        print(f"{'step widths':26} {widths} m")
    print(f"{'recording':26} {answer['recording']}")


def _show_side(name: str, side: Passivity | None) -> None:
    """What the passivity observer says about one side, if it can say anything."""
    if side is None:
        return
    where = ""
    if side.first_violation is not None:
        where = (
            f" by {-side.slack.min():.1e} J, first at {side.first_violation:.3f} s, {side.joint}"
        )
    print(f"{name:26} {'passive' if side.passive else 'not passive'}{where}")
