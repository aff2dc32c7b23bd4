"""A simulated run as an MCAP recording."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from sealag.files import Draft
from sealag.report._mcap import McapRecorder
from sealag.robot import Robot
from sealag.simulation import Outcome, Run
from sealag.typing import Array

_BLOCK = 500


def write_run(
    run: Run,
    robot: Robot,
    path: Path | Draft,
    *,
    project: str,
    version: str,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write a run: joint states, torques, link poses, contact, energy, works and origin.

    How the run ended is written last, so that a recording that a full disk cut off does not say it.

    Args:
        run: the run.
        robot: whose run it is.
        path: the MCAP file, or the draft of it.
        project: text of the project file, attached.
        version: of sealag.
        progress: called with the time up to which the run is written, s.

    Returns:
        Where the recording is: beside the path if the run was interrupted and another is there.

    Raises:
        FileError: it cannot be written; a full disk leaves what was written readable.
    """
    metadata = {
        "sealag": version,
        "robot": robot.name,
        "urdf_sha256": robot.urdf_sha256,
        "seed": str(run.seed),
    }
    frames = robot.link_names()
    attachments = {"project.toml": project.encode()}
    if robot.urdf_path is not None:
        attachments[robot.urdf_path.name] = robot.urdf_path.read_bytes()
    with McapRecorder(
        path=path, joints=run.joints, metadata=metadata, attachments=attachments,
        whole=run.outcome is not Outcome.INTERRUPTED,
    ) as recorder:  # fmt: skip
        for rows in run.blocks(_BLOCK):
            time = run.time[rows]
            q_joint = robot.joint_positions(run.q[rows])
            rates = run.v[rows, robot.nv_base :]
            recorder.write_joint_states(time, q_joint, rates, effort=run.tau_sea[rows])
            for topic, values, unit in (
                ("/motor/position", run.theta, "rad"),
                ("/motor/velocity", run.theta_dot, "rad_s"),
                ("/torque/command", run.tau_command, "nm"),
                ("/torque/acting", run.tau_osc, "nm"),
                ("/torque/spring", run.tau_sea, "nm"),
                ("/torque/motor", run.tau_motor, "nm"),
            ):
                names = [f"{joint}_{unit}" for joint in run.joints]
                recorder.write_signal(topic, names, time, values=values[rows])
            for topic, columns in (
                ("/delay", _ages(run, rows)),
                ("/energy", _energies(run, rows)),
                ("/work", _works(run, rows)),
                ("/power/port", _port_powers(run, rows, rates)),
                ("/contact", _contacts(run, rows)),
            ):
                if columns:
                    values = np.column_stack(list(columns.values()))
                    recorder.write_signal(topic, list(columns), time, values=values)
            recorder.write_transforms(frames, time, _poses(robot, frames, run.q[rows]))
            if progress is not None:
                progress(float(time[-1]))
        recorder.note("end", {"outcome": run.outcome.value, "message": run.message})
    assert recorder.saved is not None
    return recorder.saved


def _ages(run: Run, rows: slice) -> dict[str, Array]:
    return {"measurement_s": run.measurement_age[rows], "command_s": run.command_age[rows]}


def _energies(run: Run, rows: slice) -> dict[str, Array]:
    """What is stored, and what the books of the first law leave open."""
    books = run.audit
    named = {
        **books.stores,
        "controller": books.controller_storage,
        "tank": books.tank,
        "delay_line": books.delay_storage,
        "residual": books.residual,
    }
    return {f"{name}_j": values[rows] for name, values in named.items() if values is not None}


def _works(run: Run, rows: slice) -> dict[str, Array]:
    """Works since the start by mechanism, and the slack of each passivity observer."""
    books = run.audit
    sides = {
        "joint_side_slack": books.joint_side,
        "controller_side_slack": books.controller_side,
        "delay_side_slack": books.delay_side,
    }
    named = {
        **books.scalar_flows,
        "inertia_shaping": books.inertia_shaping,
        "delay_injection": books.delay_injection,
        "law_injection": books.law_injection,
        **{name: None if side is None else side.slack for name, side in sides.items()},
    }
    works = {name: works[rows].sum(axis=1) for name, works in books.joint_flows.items()}
    works |= {name: values[rows] for name, values in named.items() if values is not None}
    return {f"{name}_j": values for name, values in works.items()}


def _port_powers(run: Run, rows: slice, rates: Array) -> dict[str, Array]:
    """What the springs give the links."""
    powers = (run.tau_sea[rows] * rates).T
    return {f"{joint}_w": power for joint, power in zip(run.joints, powers, strict=True)}


def _contacts(run: Run, rows: slice) -> dict[str, Array]:
    """Mode (0 open, 1 sticking, 2 slipping) and force of each contact point."""
    columns: dict[str, Array] = {}
    for point, foot in enumerate(run.feet):
        number = run.feet[:point].count(foot)
        name = f"{foot}_{number}" if run.feet.count(foot) > 1 else foot
        columns[f"{name}_mode"] = run.contact_mode[rows, point].astype(float)
        for axis, way in enumerate(("tangent_1", "tangent_2", "normal")):
            columns[f"{name}_{way}_n"] = run.contact_force[rows, point, axis]
    return columns


def _poses(robot: Robot, frames: Sequence[str], q: Array) -> Array:
    """Position and quaternion (N, 7 k) of each frame, one behind the other."""
    from scipy.spatial.transform import Rotation

    turns, places = np.zeros((len(q), len(frames), 3, 3)), np.zeros((len(q), len(frames), 3))
    for row, configuration in enumerate(q):
        at = robot.workspace_at(configuration)
        for k, frame in enumerate(frames):
            turns[row, k], places[row, k] = at.frame_placement(frame)
    quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat()
    return np.dstack([places, quaternions.reshape(*places.shape[:2], 4)]).reshape(len(q), -1)
