"""A simulated run as an MCAP recording."""

from pathlib import Path

import numpy as np

from sealag.report._mcap import McapRecorder
from sealag.robot import Robot
from sealag.simulation import Run

_BLOCK = 500


def write_run(run: Run, robot: Robot, path: Path, *, project: str, version: str) -> None:
    """Write a run: joint states, torques, frame poses, contact, energy, and what it was run from.

    Args:
        run: the run.
        robot: whose run it is.
        path: the MCAP file.
        project: text of the project file, attached.
        version: of sealag.

    Raises:
        FileError: it cannot be written; a full disk leaves what was written readable.
    """
    metadata = {
        "sealag": version,
        "robot": robot.name,
        "urdf_sha256": robot.urdf_sha256,
        "seed": str(run.seed),
        "outcome": run.outcome.value,
        "message": run.message,
    }
    frames = [frame for frame in robot.frame_names() if frame not in ("universe", "root_joint")]
    attachments = {
        "project.toml": project.encode(),
        robot.urdf_path.name: robot.urdf_path.read_bytes(),
    }
    books = run.audit
    with McapRecorder(
        path=path, joints=run.joints, metadata=metadata, attachments=attachments
    ) as recorder:
        for first in range(0, len(run.time), _BLOCK):
            rows = slice(first, first + _BLOCK)
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
            ages = np.column_stack([run.measurement_age[rows], run.command_age[rows]])
            recorder.write_signal("/delay", ["measurement_s", "command_s"], time, values=ages)
            energy = np.column_stack(
                [*(e[rows] for e in books.stores.values()), books.residual[rows]]
            )
            names = [*(f"{name}_j" for name in books.stores), "residual_j"]
            recorder.write_signal("/energy", names, time, values=energy)
            poses = np.array([_poses(robot, frames, q) for q in run.q[rows]])
            recorder.write_transforms(frames, time, poses)


def _poses(robot: Robot, frames: list[str], q: np.ndarray) -> np.ndarray:
    """Position and quaternion of each frame, one behind the other."""
    row = []
    at = robot.workspace_at(q)
    for frame in frames:
        rotation, position = at.frame_placement(frame)
        row += [*position, *_quaternion(rotation)]
    return np.array(row)


def _quaternion(R: np.ndarray) -> np.ndarray:
    """x, y, z, w of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_quat()
