"""Assumption 3 as a number: the plant of (1) to (3), with rotors that turn with their links.

A rotor sits on the link before its joint and spins about the joint's axis z, r times as fast as the
joint side sees it. With its spin inertia I = B/r², Assumptions 1 and 2 give
T = ½ q̇ᵀA q̇ + q̇ᵀC θ̇ + ½ θ̇ᵀB θ̇ with C = J_ωᵀ z B/r, J_ω of the link that carries the rotor, and
by balance of angular momentum

    A q̈ + N + Σ J_ωᵀ (B/r) (θ̈ z + θ̇ ω × z) + J_sᵀ F_r = Uᵀ Γ_sea,
    B θ̈ + (B/r) z·(J_ω q̈ + J̇_ω q̇) + Γ_sea = Γ_m,

the second terms being C θ̈, b_q θ̇ and Cᵀ q̈, b_θᵀ q̇ of (3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from humanoids2016._live import LiveLeg
from humanoids2016._slow_model import held_legs
from humanoids2016._walk import Walk
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.design import System
from sealag.errors import RobotError
from sealag.margin import DelayedLoop
from sealag.robot import Robot
from sealag.simulation import Clock, Network, closed_loop
from sealag.typing import Array
from sealag.whole_body import Measurement

RATIOS = (10.0, 50.0, 100.0)
"""Gear ratios r; Hume's are not published."""
ROWS = 150
"""Instants of the simulated walk at which accelerations are compared."""
TICK = 1e-3  # s
STEP = 5e-4  # s, of the Runge-Kutta steps
LATE = 33  # ticks: the paper's largest d_1
REACH, RATE = 0.15, 2.0 * np.pi  # m, rad/s: the foot's swing


class Accelerations(NamedTuple):
    """What a plant does at an instant."""

    link: Array  # (nv,) q̈
    motor: Array  # (n,) θ̈


class CoupledRotors:
    """A robot whose rotors are coupled to the links that carry them, Eq. (3)."""

    def __init__(self, robot: Robot, drives: Actuators, ratio: float) -> None:
        """Find which link carries each rotor.

        Args:
            robot: read from a URDF.
            drives: its springs and motors.
            ratio: r of every gear; infinite for Assumption 3.

        Raises:
            RobotError: the robot was not read from a file.
        """
        if robot.urdf_path is None:
            raise RobotError(f"{robot.name} is of no URDF that says which link carries a motor.")
        joints = {j.get("name"): j for j in ElementTree.parse(robot.urdf_path).iter("joint")}
        self.robot, self.drives, self._at = robot, drives, robot.workspace()
        self._spin = drives.rotor_inertia / ratio  # B/r
        self._carriers = [_link(joints[name], "parent") for name in robot.joints]
        self._driven = [_link(joints[name], "child") for name in robot.joints]

    def coupling(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return C (nv, n), b_q θ̇ per θ̇ (nv, n) and b_θᵀ q̇ (n,) of Eq. (3).

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.
        """
        at, n, nv = self._at, self.robot.n, self.robot.nv
        at.update(q, v)
        C, gyro, drift = np.zeros((nv, n)), np.zeros((nv, n)), np.zeros(n)
        if not self._spin.any():
            return C, gyro, drift
        for j, (carrier, driven) in enumerate(zip(self._carriers, self._driven, strict=True)):
            axis = at.frame_jacobian(driven)[3:, nv - n + j].copy()
            J = at.frame_jacobian(carrier)[3:]
            C[:, j] = self._spin[j] * (J.T @ axis)
            gyro[:, j] = self._spin[j] * (J.T @ np.cross(J @ v, axis))
            drift[j] = self._spin[j] * float(axis @ at.frame_bias(carrier)[3:])
        return C, gyro, drift

    def accelerate(
        self, q: Array, v: Array, theta: Array, theta_dot: Array, *, motor: Array,
        feet: Sequence[str] = (), load: Array | float = 0.0,
    ) -> Accelerations:  # fmt: skip
        """Solve Eq. (3) with feet that stick.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.
            theta: (n,) motor angles, rad.
            theta_dot: (n,) motor speeds, rad/s.
            motor: (n,) Γ_m, Nm.
            feet: point contacts.
            load: (nv,) force on the links, Nm and N.
        """
        n, nv, at = self.robot.n, self.robot.nv, self._at
        C, gyro, drift = self.coupling(q, v)
        torque = self.drives.spring_stiffness * (theta - q[-n:])
        J = np.concatenate([at.frame_jacobian(foot)[:3] for foot in feet] or [np.zeros((0, nv))])
        bias = np.concatenate([at.frame_bias(foot)[:3] for foot in feet] or [np.zeros(0)])
        size = nv + n + len(J)
        K, right = np.zeros((size, size)), np.zeros(size)
        K[:nv, :nv], K[:nv, nv : nv + n], K[nv : nv + n, :nv] = at.M, C, C.T
        K[nv : nv + n, nv : nv + n] = np.diag(self.drives.rotor_inertia)
        K[:nv, nv + n :], K[nv + n :, :nv] = -J.T, J
        right[:nv] = load - at.nle - gyro @ theta_dot
        right[nv - n : nv] += torque
        right[nv : nv + n] = motor - torque - drift
        right[nv + n :] = -bias
        found = np.linalg.solve(K, right)
        return Accelerations(found[:nv], found[nv : nv + n])


def _link(joint: ElementTree.Element, which: str) -> str:
    found = joint.find(which)
    assert found is not None
    return found.get("link", "")


@dataclass(frozen=True, slots=True, kw_only=True)
class RotorRow:
    """What Assumption 3 leaves out at one gear ratio.

    Attributes:
        ratio: r.
        coupling: largest ‖B^-½ Cᵀ A^-½‖ along the simulated walk; 1 would be a singular inertia.
        link: RMS error of q̈_j along it over the RMS of q̈_j, feet sticking.
        motor: the same of θ̈.
        torque_nm: RMS of Cᵀq̈ + b_θᵀq̇, the torque that (5) leaves out, Nm.
        margin_s: smallest exact margin of the stance leg with C, its torso held, s.
        margin_change: its largest relative change by C along the walk.
        swing_rad: largest deviation of a swinging leg's joints from the plant without C, rad.
        swing_nm: the same of its spring torques, Nm.
    """

    ratio: float
    coupling: float
    link: float
    motor: float
    torque_nm: float
    margin_s: float
    margin_change: float
    swing_rad: float
    swing_nm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RotorTable:
    """Assumption 3 over gear ratios.

    Attributes:
        rows: one for each ratio.
        reference_rad: largest deviation of the plant without C here from the library's simulator
            over the same swing, rad.
        swing_time: how long the swing is, s.
    """

    rows: tuple[RotorRow, ...]
    reference_rad: float
    swing_time: float


def rotor_table(
    system: System,
    walk: Walk,
    live: LiveLeg,
    *,
    ratios: Sequence[float] = RATIOS,
    swing_time: float = 1.0,
) -> RotorTable:
    """Compare the plants of (3) and of (4), (5).

    Args:
        system: Hume with the paper's gains.
        walk: the simulated walk.
        live: the stance leg along the planned walk.
        ratios: gear ratios.
        swing_time: how long a leg swings on both plants, s.
    """
    held = held_legs(system)
    plain, reference = _swing(held, np.inf, swing_time), _simulated(held, swing_time)
    step = round(TICK / STEP)
    rows = min(len(plain[0][::step]), len(reference))
    away = float(np.abs(plain[0][::step][:rows] - reference[:rows]).max())
    return RotorTable(
        rows=tuple(_row(system, walk, live, held, plain, ratio) for ratio in ratios),
        reference_rad=away,
        swing_time=swing_time,
    )


def _row(
    system: System,
    walk: Walk,
    live: LiveLeg,
    held: System,
    plain: tuple[Array, Array],
    ratio: float,
) -> RotorRow:
    run, robot, drives = walk.run, system.robot, system.actuators
    coupled, free = (CoupledRotors(robot, drives, r) for r in (ratio, np.inf))
    sizes, errors, sums, left_out = [], [], [], []
    for k in np.unique(np.linspace(0, len(run.time) - 1, ROWS).astype(int)).tolist():
        feet = [run.feet[p] for p in np.flatnonzero(run.contact_mode[k] > 0)]
        state = run.q[k], run.v[k], run.theta[k], run.theta_dot[k]
        with_C, without = (
            plant.accelerate(*state, motor=run.tau_motor[k], feet=feet) for plant in (coupled, free)
        )
        C, _, drift = coupled.coupling(run.q[k], run.v[k])
        A = np.linalg.cholesky(robot.mass_matrix(run.q[k]))
        sizes.append(np.linalg.norm(np.linalg.solve(A, C) / np.sqrt(drives.rotor_inertia), 2))
        n = robot.n
        errors.append([_square(with_C.link[-n:] - without.link[-n:]),
                       _square(with_C.motor - without.motor)])  # fmt: skip
        sums.append([_square(without.link[-n:]), _square(without.motor)])
        left_out.append(_square(C.T @ with_C.link + drift))
    link, motor = np.sqrt(np.sum(errors, axis=0) / np.sum(sums, axis=0)).tolist()
    q, torque = _swing(held, ratio, STEP * (len(plain[0]) - 1))
    margins = np.array([_margins(live, k, ratio) for k in range(len(live.time))])
    return RotorRow(
        ratio=ratio, coupling=float(max(sizes)), link=link, motor=motor,
        torque_nm=float(np.sqrt(np.mean(left_out))),
        margin_s=float(margins[:, 0].min()),
        margin_change=float(np.abs(margins[:, 0] / margins[:, 1] - 1.0).max()),
        swing_rad=float(np.abs(q - plain[0]).max()),
        swing_nm=float(np.abs(torque - plain[1]).max()),
    )  # fmt: skip


def _square(values: Array) -> float:
    return float(np.mean(values**2))


def _margins(live: LiveLeg, k: int, ratio: float) -> tuple[float, float]:
    """Exact margins of the stance leg with and without C, s.

    The torque feedback of (7) does not know C: B_s θ̈ + B_s B⁻¹ Cᵀ q̈ + D_θ θ̇ + Γ_sea = Γ_osc.
    """
    n, J = 3, live.J_star[k]
    values, V = np.linalg.eigh(live.Lambda[k])
    root = (V * np.sqrt(np.clip(values, 0.0, None))) @ V.T
    F = J.T @ root @ np.diag(live.gains) @ root @ J
    K, D = np.diag(live.spring_stiffness), np.diag(live.motor_damping)
    B_s = live.inertia_shaping * live.rotor_inertia
    zero, found = np.zeros((n, n)), []
    for r in (ratio, np.inf):
        C = live.spin[k] * live.rotor_inertia / r
        shaped = live.inertia_shaping * C.T
        inertia = np.linalg.inv(np.block([[live.mass[k], C], [shaped, np.diag(B_s)]]))
        stiffness, damping = np.block([[K, -K], [-K, K]]), np.block([[zero, zero], [zero, D]])
        A_0 = np.block([
            [np.zeros((2 * n, 2 * n)), np.eye(2 * n)],
            [-inertia @ stiffness, -inertia @ damping],
        ])  # fmt: skip
        A_1 = np.zeros_like(A_0)
        A_1[2 * n :, n : 2 * n] = -inertia[:, n:] @ F
        found.append(DelayedLoop(A_0, A_1).margin().delay)
    return found[0], found[1]


def _wave(rows: int):
    """The right foot forth and back: offset (m,) of the references and its rate at a time."""

    def reference(t: float) -> tuple[Array, Array]:
        offset, rate = np.zeros(rows), np.zeros(rows)
        offset[0] = REACH * (1.0 - np.cos(RATE * t)) / 2.0
        rate[0] = REACH * RATE * np.sin(RATE * t) / 2.0
        return offset, rate

    return reference


def _simulated(held: System, duration: float) -> Array:
    """The swing on the library's simulator: joint angles (N, n) at every tick."""
    still = Link(delay=Constant(value=0.0))
    late = Link(delay=Constant(value=LATE * TICK))
    rest = held.rest()
    run = closed_loop(
        held.robot, held.actuators,
        held.controller(reference=_wave(held.law.levels(held.robot)[-1])),
        q=rest.q, theta=rest.theta, duration=duration,
        network=Network(central_up=still, central_down=late, embedded_down=still),
        clock=Clock(physics=STEP, central=TICK),
    )  # fmt: skip
    return run.q


def _swing(held: System, ratio: float, duration: float) -> tuple[Array, Array]:
    """The same on the plant of (3): joint angles and spring torques (N, n) at every step."""
    robot, drives, n = held.robot, held.actuators, held.robot.n
    plant, rest = CoupledRotors(robot, drives, ratio), held.rest()
    controller = held.controller(reference=_wave(held.law.levels(robot)[-1]))
    measured = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=n)
    gain, damping = drives.inertia_shaping, drives.motor_damping
    state = np.concatenate([rest.q, np.zeros(n), rest.theta, np.zeros(n)])
    sense(measured, 0.0, state, drives)
    controller.reset(0.0, measured)
    sent, every = [], round(TICK / STEP)
    angles, torques = [], []

    def slope(state: Array, command: Array) -> Array:
        q, v, theta, rate = np.split(state, 4)
        spring = drives.spring_stiffness * (theta - q)
        motor = spring + (command - spring - damping * rate) / gain  # (7)
        found = plant.accelerate(q, v, theta, rate, motor=motor)
        return np.concatenate([v, found.link, rate, found.motor])

    for step in range(round(duration / STEP) + 1):
        if step % every == 0:
            t, out = step * STEP, np.zeros(n)
            sense(measured, t, state, drives)
            controller.tick(t, measured, out)
            sent.append(out)
        q, _, theta, _ = np.split(state, 4)
        angles.append(q)
        torques.append(drives.spring_stiffness * (theta - q))
        tau = sent[max(len(sent) - 1 - LATE, 0)]
        a = slope(state, tau)
        b = slope(state + 0.5 * STEP * a, tau)
        c = slope(state + 0.5 * STEP * b, tau)
        d = slope(state + STEP * c, tau)
        state = state + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return np.array(angles), np.array(torques)


def sense(measured: Measurement, t: float, state: Array, drives: Actuators) -> None:
    """Write what the sensors of a fixed robot say.

    Args:
        measured: written.
        t: s.
        state: (4n,) q, q̇, θ, θ̇.
        drives: whose springs.
    """
    q, v, theta, rate = np.split(state, 4)
    measured.data[0] = t
    measured.q[:], measured.v[:] = q, v
    measured.theta[:], measured.theta_dot[:] = theta, rate
    measured.tau_sea[:] = drives.spring_stiffness * (theta - q)
