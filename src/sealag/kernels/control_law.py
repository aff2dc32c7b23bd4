"""The whole-body law: task errors and matrices, torques, q̄(θ) and the energy tank."""

import math
from typing import NamedTuple

from sealag.kernels._jit import entry, inner
from sealag.kernels.dynamics import (
    Frames,
    Mounts,
    Terms,
    Tree,
    frame_terms,
    gravity_hessian,
    rigid_body_terms,
)
from sealag.kernels.linalg import copy, eliminate, multiply, substitute
from sealag.kernels.operational_space import Space, operational_space, task_torque
from sealag.kernels.spatial import integrate
from sealag.kernels.task_error import frame_error, leave_to_higher
from sealag.typing import Array, IntArray

OF_FRAME, OF_MASS, OF_JOINT = 0, 1, 2  # what a task row measures
MEASURED, STATIC, TANK = range(3)  # the law is taken at given angles, at q̄(θ), at x̂
EXISTS, SINGULAR_MASS, NO_STATIC_STATE = range(3)  # how `tick` ends
_PIVOT = 1e-12
"""Of a spring: pivots below count as none. Ten times smaller meets rounding where a law is as stiff
as its springs; ten times larger refuses no law of use."""


class Tasks(NamedTuple):
    """Contacts and tasks about a posture: c contact rows, m task rows in k levels, F frames."""

    contact_frame: IntArray  # (c,)
    contact_row: IntArray  # (c,) of its Jacobian
    kind: IntArray  # (m,) OF_FRAME, OF_MASS or OF_JOINT
    frame: IntArray  # (m,) where kind is OF_FRAME
    row: IntArray  # (m,) of what it measures
    levels: IntArray  # (k + 1,) first row of each level, then m
    R: Array  # (F, 3, 3) wanted rotations of frames
    p: Array  # (F, 3) wanted positions of frames, m
    x: Array  # (m,) wanted values of the other rows


class Gains(NamedTuple):
    """How errors become torques."""

    K_x: Array  # (m, m) task stiffness
    planned_gravity: Array  # (n,) Nm
    springs: Array  # (n,) K, Nm/rad
    form: int  # SYMMETRIC, PUBLISHED or FORCE
    star: bool  # whether stiffness uses Λ*
    tolerance: float  # below which a direction counts as lost
    consistent: bool  # whether tasks leave errors to higher ones
    fed_back: bool  # whether gravity compensation is of the joint angles instead of planned


class Evaluation(NamedTuple):
    """The law where it was last evaluated."""

    along: Array  # (nv, n) motions by which the base follows the joints
    offset: Array  # (m,) of the references
    shift: Array  # (nv,) from the measured configuration
    q: Array  # (nq,) configuration
    J_s: Array  # (c, nv) contact Jacobian
    J_t: Array  # (m, nv) task Jacobian
    error: Array  # (m,) x̃
    wanted: Array  # (m,) x_d about the posture's
    joints: Array  # (n,) joint angles, rad
    twist: Array  # (6,) error of a frame
    target: Array  # (m,) x(q̄(θ)), which x̂ follows
    moved: Array  # (m,) J* Δθ since the tank's last step
    pull: Array  # (m,) u of the tank


class Newton(NamedTuple):
    """Memory for q̄(θ)."""

    H: Array  # (nv, nv) ∂²V/∂q²
    moved: Array  # (nv, n) H along the contact-consistent motions
    slope: Array  # (n, n) ∂ḡ/∂q_j; 0 unless it is fed back
    J: Array  # (m, n) minus the errors' Jacobian
    force: Array  # (m, n) S J
    square: Array  # (n, n) K + ∂l/∂q_j, factored
    step: Array  # (n,)


class Control(NamedTuple):
    """A law and all that it is evaluated with."""

    tree: Tree
    mounts: Mounts  # of the contacts' frames, then the tasks'
    tasks: Tasks
    gains: Gains
    terms: Terms
    frames: Frames
    at: Evaluation
    newton: Newton
    space: Space


class Followed(NamedTuple):
    """q̄(θ) from tick to tick."""

    sag: Array  # (n,) q̄ − θ of the last tick, rad; of a first guess before
    theta: Array  # (n,) motor angles there, rad
    answer: Array  # (n, n) factors of K + ∂l/∂q_j there
    started: IntArray  # (1,) whether there was a tick


class Tank(NamedTuple):
    """An energy tank's x̂, and what it may cost."""

    position: Array  # (m,) x̂, from the posture's own
    energy: Array  # (1,) J
    rate: float  # at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s
    delay_bound: float  # s, that the tank pays for
    corrected: bool  # whether the tank pays for u's work on the potential


class Signal(NamedTuple):
    """The running signal: where the law is taken, and what is carried from tick to tick."""

    kind: int  # MEASURED, STATIC or TANK
    first: int  # Newton steps towards q̄(θ) at most in a tick that has no last one to follow
    iterations: int  # and in any other
    settled: float  # rad; a smaller step is the last
    diverged: float  # rad; a larger step means no solution nearby
    static: Followed
    tank: Tank


@entry
def tick(control, signal, period, q, angles, out):
    """Write the law's torque.

    Args:
        control: kept `Control`; where it was last evaluated is written.
        signal: kept `Signal`, moved.
        period: since the last tick, s; a tank pays for it.
        q: (nq,) measured configuration.
        angles: (n,) joint angles if the signal is MEASURED, else motor angles, rad.
        out: (n,) torque, Nm, written.

    Returns:
        EXISTS, SINGULAR_MASS or NO_STATIC_STATE.
    """
    return _tick(control.parts, signal.parts, period, q, angles, out)


@inner
def _tick(control, signal, period, q, angles, out):
    at, static = control.at, signal.static
    if signal.kind != MEASURED and static.started[0]:
        _foresee(control, static, angles)
    # One evaluation serves all signals: what is inlined once is compiled once.
    settled, steps = False, 0
    most = signal.iterations if static.started[0] else signal.first
    while True:
        for i in range(angles.size):
            at.joints[i] = angles[i]
            if signal.kind != MEASURED and not settled:
                at.joints[i] += static.sag[i]
        if not evaluate(control, q, at.joints, out):
            return SINGULAR_MASS
        if signal.kind == MEASURED or settled:
            break
        steps += 1
        status, settled = approach_static_state(control, signal, out)
        if status != EXISTS:
            return status
        settled = settled or steps >= most
        if settled:
            _end_search(control, static, out)
            for r in range(at.error.size):
                at.target[r] = at.wanted[r] - at.error[r]
            # Compensation that is fed back is taken at θ, whose gradient it has.
            if signal.kind != TANK or not control.gains.fed_back:
                break
    if signal.kind == TANK:
        _follow(control, signal, period, angles, out)
    if signal.kind != MEASURED:
        copy(angles, static.theta)
        copy(control.newton.square, static.answer)
        static.started[0] = 1
    return EXISTS


@inner
def _foresee(control, static, theta):
    """Move sag = q̄ − θ as q̄ follows the motors to first order, Δq̄ = (K + ∂l/∂q_j)⁻¹ K Δθ: the
    search for q̄(θ) then begins so near that one evaluation mostly ends it."""
    moved = control.newton.step
    for i in range(theta.size):
        moved[i] = control.gains.springs[i] * (theta[i] - static.theta[i])
    substitute(static.answer, moved)
    for i in range(theta.size):
        static.sag[i] += moved[i] - (theta[i] - static.theta[i])


@inner
def evaluate(control, q, joints, out):
    """Write the torque J*ᵀ S x̃ + ḡ at given joint angles, and everything that it is made of.

    The base follows the joints along the contact-consistent motions from the measured state.

    Args:
        control: the law; all that is evaluated is written.
        q: (nq,) measured configuration.
        joints: (n,) joint angles.
        out: (n,) torque, Nm, written.

    Returns:
        False if the mass matrix is not positive definite.
    """
    tree, terms, tasks, gains, at = (
        control.tree, control.terms, control.tasks, control.gains, control.at,
    )  # fmt: skip
    n, space = joints.size, control.space
    nv = terms.nle.size
    at.shift[:] = 0.0
    for i in range(n):
        away = joints[i] - q[q.size - n + i]
        for k in range(nv):
            at.shift[k] += at.along[k, i] * away
    integrate(q, at.shift, nv - n, at.q)
    at.shift[:] = 0.0
    rigid_body_terms(tree, at.q, at.shift, terms)  # at rest
    frame_terms(terms, control.mounts, control.frames)
    for r in range(tasks.contact_frame.size):
        copy(control.frames.J[tasks.contact_frame[r], tasks.contact_row[r]], at.J_s[r])
    _read_tasks(tasks, terms, control.frames, at)
    if not operational_space(
        terms.M, terms.nle, at.J_s, at.J_t, gains.K_x, tasks.levels, gains.form, gains.star,
        gains.tolerance, space,
    ):  # fmt: skip
        return False
    for r in range(at.error.size):
        at.error[r] += at.offset[r]
        at.wanted[r] = at.offset[r]
    if gains.consistent and tasks.levels.size > 2:
        leave_to_higher(at.J_t, space.lift, tasks.levels, at.error, at.shift)
        leave_to_higher(at.J_t, space.lift, tasks.levels, at.wanted, at.shift)
    _write_torque(control, out)
    return True


@inner
def _write_torque(control, out):
    """Write the torque of the errors and matrices that stand here now."""
    space, gains = control.space, control.gains
    gravity = space.gravity if gains.fed_back else gains.planned_gravity
    task_torque(space.J_star, space.stiffness, control.at.error, gravity, out)


@inner
def _read_tasks(tasks, terms, frames, at):
    """Write Jacobians and errors of all task rows."""
    both, last = at.twist, -1
    n = at.along.shape[1]
    first_q, base = at.q.size - n, at.along.shape[0] - n
    for r in range(at.error.size):
        kind, frame, row = tasks.kind[r], tasks.frame[r], tasks.row[r]
        if kind == OF_FRAME:
            if frame != last:
                frame_error(tasks.R[frame], tasks.p[frame], frames.R[frame], frames.p[frame], both)
                last = frame
            copy(frames.J[frame, row], at.J_t[r])
            at.error[r] = both[row]
        elif kind == OF_MASS:
            copy(terms.com_jacobian[row], at.J_t[r])
            at.error[r] = tasks.x[r] - terms.com[row]
        else:
            at.J_t[r], at.error[r] = 0.0, tasks.x[r] - at.q[first_q + row]
            at.J_t[r, base + row] = 1.0


@inner
def gravity_slope(tree, terms, along, newton):
    """Write ∂ḡ/∂q_j along the contact-consistent motions, with these motions frozen: Wᵀ H W.

    Args:
        tree: the robot.
        terms: of it, evaluated.
        along: (nv, n) W.
        newton: H, moved and slope are written.
    """
    gravity_hessian(tree, terms, newton.H)
    multiply(newton.H, along, newton.moved)
    nv, n = along.shape
    newton.slope[:] = 0.0
    for k in range(nv):
        for i in range(n):
            for j in range(n):
                newton.slope[i, j] += along[k, i] * newton.moved[k, j]


@inner
def static_step(J_star, stiffness, springs, torque, sag, newton):
    """One Newton step towards K (θ − q̄) = l(q̄), Eqs. (15), (16), with sag = q̄ − θ.

    (K − J*ᵀ S J + ∂ḡ/∂q) δ = −K sag − l by elimination, −J the errors' Jacobian; then
    sag ← sag + δ. Where the fixed point is a contraction every pivot is positive.

    Args:
        J_star: (m, n).
        stiffness: (m, m) S.
        springs: (n,) K, Nm/rad.
        torque: (n,) l at θ + sag.
        sag: (n,), moved.
        newton: slope and J are read; force, square (its factors) and step (n,) δ are written.

    Returns:
        False if a pivot is not positive: the task is stiffer than the springs.
    """
    m, n = J_star.shape
    square, step = newton.square, newton.step
    copy(newton.slope, square)
    multiply(stiffness, newton.J, newton.force)
    for r in range(m):
        for i in range(n):
            for j in range(n):
                square[i, j] -= J_star[r, i] * newton.force[r, j]
    for i in range(n):
        square[i, i] += springs[i]
        step[i] = -springs[i] * sag[i] - torque[i]
    if not eliminate(square, _PIVOT, springs):
        return False
    substitute(square, step)
    for i in range(n):
        sag[i] += step[i]
    return True


@inner
def _write_error_jacobian(control):
    """Write minus the errors' Jacobian by joint angles, where the law was last evaluated."""
    if control.gains.consistent:
        copy(control.space.J_star, control.newton.J)
    else:
        multiply(control.at.J_t, control.space.joint_from_base, control.newton.J)


@inner
def approach_static_state(control, signal, torque):
    """Do a Newton step towards q̄(θ) of Eqs. (15), (16) from where the law was evaluated.

    Args:
        control: the law, evaluated at θ + sag.
        signal: the sag of its q̄ is moved.
        torque: (n,) of the law there, Nm.

    Returns:
        EXISTS or NO_STATIC_STATE, and whether this was the last step.
    """
    gains, newton, space, sag = control.gains, control.newton, control.space, signal.static.sag
    if gains.fed_back:
        gravity_slope(control.tree, control.terms, space.joint_from_base, newton)
    _write_error_jacobian(control)
    exists = static_step(space.J_star, space.stiffness, gains.springs, torque, sag, newton)
    size = 0.0
    for i in range(newton.step.size):
        size = max(size, abs(newton.step[i]))
    if not (exists and size < signal.diverged):
        return NO_STATIC_STATE, True
    return EXISTS, size < signal.settled


@inner
def _end_search(control, static, out):
    """Write torque and error at q̄: the springs carry the law there, l(q̄) = K (θ − q̄) = −K sag, so
    that the last step needs no new evaluation."""
    at, newton = control.at, control.newton
    for i in range(out.size):
        out[i] = -control.gains.springs[i] * static.sag[i]
    for r in range(at.error.size):
        for i in range(out.size):
            at.error[r] -= newton.J[r, i] * newton.step[i]


@inner
def step_tank(tank, period, at, stiffness):
    """Move x̂ over one period, and the tank's energy with it.

    Args:
        tank: moved.
        period: T since the last step, s; at 0 or less u does nothing.
        at: moved, wanted and target are read, pull is written.
        stiffness: (m, m) S, symmetric.
    """
    moved, wanted, target, u = at.moved, at.wanted, at.target, at.pull
    m, flow, x = moved.size, 0.0, tank.position
    if period > 0.0:
        # u of the exact solution of x̂̇ = rate (target − x̂), so that no period is too long.
        pull = -math.expm1(-tank.rate * period) / period
        for r in range(m):
            u[r] = pull * (target[r] - x[r] - moved[r])
        for r in range(m):
            force, half = 0.0, 0.5 * (period * u[r] + moved[r])
            for s in range(m):
                force += stiffness[r, s] * u[s]
            flow -= tank.delay_bound * force * (half + 0.5 * moved[r])
            if tank.corrected:
                flow += period * force * (wanted[r] - x[r] - half)
        if tank.energy[0] + flow >= 0.0:
            tank.energy[0] += flow
            for r in range(m):
                x[r] += period * u[r]
    for r in range(m):
        x[r] += moved[r]


@inner
def _follow(control, signal, period, theta, out):
    """Let x̂ follow its target as far as the tank pays, and write the law's torque at x̂."""
    at, J_star, static, tank = control.at, control.space.J_star, signal.static, signal.tank
    if static.started[0]:
        at.moved[:] = 0.0
        for r in range(at.moved.size):
            for i in range(theta.size):
                at.moved[r] += J_star[r, i] * (theta[i] - static.theta[i])
        step_tank(tank, period, at, control.space.stiffness)
    else:
        copy(at.target, tank.position)
    for r in range(at.error.size):
        at.error[r] = at.wanted[r] - tank.position[r]
    _write_torque(control, out)
