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
            for topic, columns in run.signals(rows).items():
                values = np.column_stack(list(columns.values()))
                recorder.write_signal(topic, list(columns), time, values=values)
            recorder.write_transforms(frames, time, _poses(robot, frames, run.q[rows]))
            if progress is not None:
                progress(float(time[-1]))
        recorder.note("end", {"outcome": run.outcome.value, "message": run.message})
    assert recorder.saved is not None
    return recorder.saved


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
