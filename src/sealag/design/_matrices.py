"""Controllers that a project gives as matrices: A, B, C, D about the posture."""

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sealag.design._schema import MatrixKeys
from sealag.errors import InputError
from sealag.files import read_whole
from sealag.robot import Robot
from sealag.typing import Array
from sealag.whole_body import LinkAngles, Measurement

_LARGEST_BYTES = 50_000_000
_NAMES = ("A", "B", "C", "D")


@dataclass(frozen=True, slots=True, kw_only=True)
class Matrices:
    """ẋ_c = A x_c + B y, or x_{c,k+1} = A x_{c,k} + B y_k of a period, δτ = C x_c + D y.

    y is how far n positions are from where they rest, rad, then n rates, rad/s.

    Attributes:
        A: (s, s) 1/s, or a period's; s = 0 without memory.
        B: (s, 2 n).
        C: (n, s).
        D: (n, 2 n) Nm/rad, then Nms/rad.
        period: s; 0 in continuous time.
        of_links: whether links are measured instead of motors.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float
    of_links: bool

    def __call__(self, system: Any) -> "MatrixController":
        """Return the controller that ticks about the posture of a `System`."""
        return MatrixController(self, system)


class MatrixController:
    """It ticks: τ_k = τ_0 + C x_c + D y_k, τ_0 what springs carry in the posture.

    Matrices in continuous time move on exactly with y_k held for the clock's period.
    """

    def __init__(self, matrices: Matrices, system: Any) -> None:
        from scipy.linalg import expm

        rest = system.in_posture()
        joints = system.robot.joint_positions(system.posture)
        self.state_space = matrices
        self.offset = rest.tau_sea
        self.theta = joints + rest.tau_sea / system.actuators.spring_stiffness
        self._held = joints if matrices.of_links else self.theta
        self._A, self._B = matrices.A, matrices.B
        self._state = np.zeros(len(matrices.A))
        if not matrices.period:
            s = len(matrices.A)
            both = np.zeros((s + matrices.B.shape[1],) * 2)
            both[:s, :s], both[:s, s:] = matrices.A, matrices.B
            moved = expm(both * system.delays.sample_time)
            self._A, self._B = moved[:s, :s], moved[:s, s:]

    def reset(self, t: float, measurement: Measurement) -> None:
        """Forget the past: x_c = 0, where it rests."""
        self._state = np.zeros(len(self._A))

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Write the command, and move x_c on."""
        links = self.state_space.of_links
        positions = measurement.q_joint if links else measurement.theta
        rates = measurement.v_joint if links else measurement.theta_dot
        y = np.concatenate([positions - self._held, rates])
        out[:] = self.offset + self.state_space.C @ self._state + self.state_space.D @ y
        self._state = self._A @ self._state + self._B @ y


def matrices_of(keys: MatrixKeys, robot: Robot, folder: Path, sample_time: float) -> Matrices:
    """Read the matrices of a project.

    Args:
        keys: its [controller].
        robot: the robot.
        folder: where `file` is.
        sample_time: of the controller's clock, s; 0 if the project states none.

    Raises:
        FileError: there is no such file.
        InputError: matrices are missing or given twice, are no numbers or do not fit each other.
        UnknownNameError: an input or output is no joint.
    """
    if keys.time == "discrete" and not sample_time:
        raise InputError(
            'time is "discrete", but the matrices are of no period; give delays.sample_time_ms.'
        )
    inputs, outputs = (_joints(getattr(keys, name), name, robot) for name in ("inputs", "outputs"))
    given = _given(keys, folder)
    D_shape = (len(outputs), 2 * len(inputs))
    s = len(given["A"]) if "A" in given else 0
    shapes = {"A": (s, s), "B": (s, D_shape[1]), "C": (D_shape[0], s), "D": D_shape}
    for name, matrix in given.items():
        if matrix.shape != shapes[name]:
            raise InputError(
                f"{name} is {matrix.shape}; {shapes[name]} is right for {s} states, "
                f"{len(inputs)} positions with their rates as inputs, and {len(outputs)} outputs."
            )
        if not np.isfinite(matrix).all():
            raise InputError(f"{name} has entries that are not finite numbers.")
    whole = {name: given.get(name, np.zeros(shape)) for name, shape in shapes.items()}
    n = robot.n
    read, command = np.zeros((D_shape[1], 2 * n)), np.zeros((n, len(outputs)))
    read[np.arange(D_shape[1]), [*inputs, *(n + i for i in inputs)]] = 1.0
    command[outputs, np.arange(len(outputs))] = 1.0
    return Matrices(
        A=whole["A"],
        B=whole["B"] @ read,
        C=command @ whole["C"],
        D=command @ whole["D"] @ read,
        period=sample_time if keys.time == "discrete" else 0.0,
        of_links=keys.feedback == LinkAngles.name,
    )


def _joints(names: list[str], key: str, robot: Robot) -> list[int]:
    """Places of joints; all of them if none is named."""
    if not names:
        return list(range(robot.n))
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{key} lists the joint {name} twice; once is right.")
    return [robot.joint_index(name) for name in names]


def _given(keys: MatrixKeys, folder: Path) -> dict[str, Array]:
    """The matrices in the file or inline: D alone, or A, B and C, with or without D."""
    inline = {name: rows for name in _NAMES if (rows := getattr(keys, name)) is not None}
    if inline and keys.file is not None:
        raise InputError(f"file and {', '.join(inline)} are given; one of both is right.")
    found = {name: _rows(name, rows) for name, rows in inline.items()}
    if keys.file is not None:
        found = _read_npz(folder / keys.file)
    memory = [name for name in "ABC" if name in found]
    if not found or len(memory) not in (0, 3):
        missing = ", ".join(name for name in "ABC" if name not in memory)
        raise InputError(
            f"the matrices {missing} are missing; give D alone for a controller without memory, "
            "else A, B and C, and D if it is not 0, as lists of rows or in a file."
        )
    return found


def _rows(name: str, rows: list[list[float]]) -> Array:
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"{name} has rows of different lengths.")
    if not rows or not rows[0]:
        raise InputError(f"{name} is empty; leave out A, B and C of a controller without memory.")
    return np.array(rows, dtype=float)


def _read_npz(path: Path) -> dict[str, Array]:
    content = read_whole(path, what="The file of matrices", largest=_LARGEST_BYTES)
    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise InputError(f"{path} is no NPZ file; np.savez(file, A=A, B=B, C=C, D=D) writes one.")
    try:
        data = np.load(io.BytesIO(content), allow_pickle=False)
        found = {name: data[name] for name in data if name in _NAMES}
    except Exception as error:
        reason = " ".join(str(error).split())[:200].rstrip(".")
        raise InputError(f"{path} cannot be read as matrices: {reason}.") from error
    for name, matrix in found.items():
        if matrix.ndim != 2 or matrix.dtype.kind not in "fiu":
            raise InputError(
                f"{name} in {path} has type {matrix.dtype} and shape {matrix.shape}; a matrix of "
                "real numbers is right."
            )
    return {name: matrix.astype(float) for name, matrix in found.items()}
