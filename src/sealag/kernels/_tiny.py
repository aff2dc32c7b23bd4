"""A tiny robot, one tick and one step of it: everything that commands run is compiled by them."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from sealag.kernels import (
    contact,
    control_law,
    dynamics,
    motor,
    numerical_radius,
    operational_space,
    plant,
    run,
    task_error,
    walking,
    walking_law,
    walking_state,
)
from sealag.kernels._jit import keep

_NV, _NQ = 7, 8  # a free body and one joint


def entries() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Return what to call, and the name of the kernels that it compiles."""
    yield "numerical_radius", _radius
    yield "dynamics", _terms
    yield "operational_space", _spaces
    yield "control_law", _tick
    yield "plant", _step
    yield "walking", _walk


def _tree(joints: int) -> dynamics.Tree:
    count = 2 + joints
    column = np.array([0, 0, *range(6, 6 + joints)])
    eye = np.tile(np.eye(3), (count, 1, 1))
    return dynamics.Tree(
        kind=np.array([0, dynamics.FREE] + [dynamics.REVOLUTE] * joints),
        parent=np.array([0, 0] + [1] * joints), column=column, coordinate=column, rotation=eye,
        position=np.zeros((count, 3)), axis=np.tile([0.0, 0.0, 1.0], (count, 1)),
        mass=np.ones(count), lever=np.zeros((count, 3)), inertia=eye.copy(), ratio=np.ones(count),
        offset=np.zeros(count), extra=1,
    )  # fmt: skip


def _mounts(feet: int, columns: int) -> dynamics.Mounts:
    return dynamics.Mounts(
        joint=np.ones(feet, np.int64), rotation=np.tile(np.eye(3), (feet, 1, 1)),
        position=np.zeros((feet, 3)), support=np.ones((feet, columns), np.int64),
    )  # fmt: skip


def _upright(joints: int) -> np.ndarray:
    q = np.zeros(7 + joints)
    q[6] = 1.0
    return q


def _radius() -> None:
    A = np.array([[[1.0, 2.0], [0.0, 1.0]]])
    numerical_radius.numerical_radii(A, np.zeros(1), 1e-6, np.zeros(1), np.zeros(1), np.zeros(1))


def _terms() -> None:
    tree, q = _tree(1), _upright(1)
    terms, frames = dynamics.allocate(tree), dynamics.allocate_frames(1, _NV)
    model = keep(dynamics.Model(tree, terms))
    dynamics.evaluate(model, q, np.zeros(_NV))
    dynamics.frames(keep(dynamics.Placed(terms, _mounts(1, _NV), frames)))
    dynamics.gravity_gradient(model, np.zeros((_NV, _NV)))


def _spaces() -> None:
    terms = operational_space.StackedTerms(
        M=np.eye(2)[None], g=np.zeros((1, 2)), J_s=np.array([[[1.0, 0.5]]]),
        J_t=np.array([[[0.0, 1.0]]]),
    )  # fmt: skip
    shapes = ((1, 1), (1, 1), (1, 1), (2, 1), (1,), (1, 2))
    out = operational_space.StackedSpaces(*(np.zeros((1, *shape)) for shape in shapes))
    stack = operational_space.Stack(
        terms=terms, K_x=np.eye(1), levels=np.array([0, 1]), form=operational_space.SYMMETRIC,
        star=False, tolerance=1e-10, out=out, space=operational_space.allocate(2, 1, 1, m=1),
    )  # fmt: skip
    operational_space.operational_spaces(keep(stack))


def _tick() -> None:
    tree, one, none = _tree(1), np.zeros(1), np.zeros(1, np.int64)
    square, nv = np.zeros((1, 1)), _NV
    tasks = control_law.Tasks(
        contact_frame=none, contact_row=none, kind=none, frame=none, row=none,
        levels=np.array([0, 1]), R=np.eye(3)[None], p=np.zeros((1, 3)), x=one,
    )  # fmt: skip
    gains = control_law.Gains(
        K_x=np.eye(1), planned_gravity=one, springs=np.ones(1), form=operational_space.SYMMETRIC,
        star=False, tolerance=1e-9, consistent=True, fed_back=False,
    )  # fmt: skip
    at = control_law.Evaluation(
        along=np.zeros((nv, 1)), offset=one.copy(), shift=np.zeros(nv), q=np.zeros(_NQ),
        J_s=np.zeros((1, nv)), J_t=np.zeros((1, nv)), error=one.copy(), wanted=one.copy(),
        joints=one.copy(), twist=np.zeros(6), target=one.copy(), moved=one.copy(), pull=one.copy(),
    )  # fmt: skip
    newton = control_law.Newton(
        H=np.zeros((nv, nv)), moved=np.zeros((nv, 1)), slope=square, J=square.copy(),
        force=square.copy(), square=square.copy(), step=one.copy(),
    )  # fmt: skip
    control = control_law.Control(
        tree=tree, mounts=_mounts(1, nv), tasks=tasks, gains=gains, terms=dynamics.allocate(tree),
        frames=dynamics.allocate_frames(1, nv), at=at, newton=newton,
        space=operational_space.allocate(nv, 1, 1, m=1),
    )  # fmt: skip
    signal = control_law.Signal(
        kind=control_law.TANK, first=1, iterations=1, settled=1e-12, diverged=10.0,
        static=control_law.Followed(one.copy(), one.copy(), square.copy(), none.copy()),
        tank=control_law.Tank(
            position=one.copy(), energy=np.ones(1), rate=1.0, delay_bound=0.0, corrected=True
        ),
    )  # fmt: skip
    out = one.copy()
    control_law.tick(keep(control), keep(signal), 1e-3, _upright(1), one, out)
    task_error.leave_to_higher(at.J_t, np.zeros((1, nv)), tasks.levels, out, np.zeros(nv))


def _plant() -> contact.Plant:
    one = np.ones(1)
    motors = motor.Motors(*(np.ones(1) for _ in motor.Motors._fields))
    contacts = contact.Contacts(
        frame=np.zeros(1, np.int64), offset=np.zeros((1, 3)), C=np.eye(3)[None],
        anchor=np.zeros((1, 3)), friction=one, ridge=np.zeros(1), radius=np.zeros(1),
        torsion_damping=np.zeros(1), torsion_radius=np.zeros(1), load=np.zeros((0, 3)),
        closed=np.ones(1, np.int64), yielding=np.zeros(1), floor=np.zeros(1), ground_x=np.zeros(1),
        ground_z=np.zeros(1), stabilisation=50.0, stop_time=1e-3, weight=30.0,
    )  # fmt: skip
    return contact.Plant(_tree(1), _mounts(1, _NV), motors, contacts)


def _step() -> None:
    parts = _plant()
    physics = plant.allocate_physics(parts, instant=True)
    physics.now.q[:] = _upright(1)
    kept, three = keep(physics), np.zeros((1, 3))
    contact.smallest_margin(
        np.eye(3)[None], parts.contacts.closed, 1.0, three, np.zeros(1), three.copy()
    )
    plant.sense(kept, 0.0, np.zeros(1 + _NQ + _NV + 3 + 2))
    plant.fastest_motors(kept, np.zeros(1))
    motor.rate_rows(tuple(parts.motors), True, np.zeros((6, 1)), np.zeros((6, 1)))
    run.carry_work(keep(run.allocate_undelayed(1)), np.zeros(1))
    start = (0.0, 0, 0, run.WATCH)
    run.drive(kept, keep(run.idle(1)), plant.STORE, 1e-3, parts.contacts.closed, three, start, 1.0)


def _different(kind: Any) -> Any:
    """Numbers of which no two are equal, so that no difference is 0."""
    return kind(*(1.0 + 0.1 * k for k in range(len(kind._fields))))


def _walk() -> None:
    six, three, q = np.zeros(6), np.zeros(3), _upright(6)
    walking.quintic(three, three, 1.0, six)
    walking.quintic_at(six, 0.5, three.copy())
    step = walking.StepNow(
        old=three, new=three, height=six, offset=0.0, phase=0.1, side=1.0, end_forward=0.1
    )
    gait, plan = tuple(_different(walking.Gait)), tuple(_different(walking.SwingPlan))
    walking.capture_end(three, three, six[:2], tuple(step), gait, 1.0, np.zeros((2, 2)))
    walking.swing(np.zeros((3, 3)), three, 0.1, 1e-3, plan, 0.0, 0.1)
    tree = _tree(6)
    springs = walking_law.Springs(
        stiffness=np.ones(6), damping=six.copy(), lag=six.copy(), limit=np.ones(6),
        table=np.zeros((6, 2, 4)),
    )  # fmt: skip
    biped = walking_law.Biped(
        tree=tree, terms=dynamics.allocate(tree), mounts=_mounts(2, 12),
        feet=dynamics.allocate_frames(2, 12), springs=springs,
        flight=walking_law.Flight(np.zeros(4), np.zeros((4, 6))),
        gains=_different(walking_law.Gains), lead=_different(walking_law.Lead), q=q,
        v=np.zeros(12), motor=np.zeros((6, 2)), anchor=np.zeros((2, 3)), tau_sea=six.copy(),
        tau=six.copy(), rates=six.copy(), smooth=six.copy(),
        scratch=walking_law.allocate_scratch(12, 6),
    )  # fmt: skip
    kept = keep(biped)
    timing = walking_state.Timing(
        measured=0.0, period=1e-3, ticks=1, touchdown=0.0, lift_off=0.0, stance=0, foot=0, newest=0
    )
    walking_state.foresee(kept, tuple(timing))
    wish = walking_law.Reference(
        height=six, height_time=0.1, swing=np.zeros((3, 3)), phase=0.1, transfer_time=0.05,
        stance=0, still=False,
    )  # fmt: skip
    walking_law.command(kept, tuple(wish), True, six.copy())
