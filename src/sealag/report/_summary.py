"""What a run comes to: the numbers of its JSON answer."""

from pathlib import Path
from typing import Any

import numpy as np

from sealag.simulation import Run
from sealag.typing import Array


def run_summary(run: Run, *, recording: Path) -> dict[str, Any]:
    """Return what a run's JSON answer holds.

    Args:
        run: the run.
        recording: the file that holds it.
    """
    books = run.audit
    joint, central, delay = books.joint_side, books.controller_side, books.delay_side
    return {
        "outcome": run.outcome.value,
        "message": run.message,
        "duration_s": float(run.time[-1]),
        "seed": run.seed,
        "recording": str(recording),
        "largest_joint_speed_rad_s": _largest_size(run.theta_dot),
        "largest_spring_torque_nm": _largest_size(run.tau_sea),
        "measurement_age_s": run.ages.measurement,
        "command_age_s": run.ages.command,
        "total_age_s": run.ages.total,
        "energy_residual_j": _largest_size(books.residual),
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


def _largest_size(values: Array) -> float:
    return max(float(values.max()), -float(values.min()))


def _largest_magnitude(values: Array | None) -> float | None:
    """The value that is furthest from 0, with its sign."""
    return None if values is None else float(values[np.abs(values).argmax()])
