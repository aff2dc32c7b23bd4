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
from sealag.kernels.ledger import Ledger

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
    tree = _tree(1)
    terms, frames = dynamics.allocate(tree), dynamics.allocate_frames(1, _NV)
    dynamics.evaluate(tuple(tree), _upright(1), np.zeros(_NV), tuple(terms))
    dynamics.frames(tuple(terms), tuple(_mounts(1, _NV)), tuple(frames))
    dynamics.gravity_gradient(tuple(tree), tuple(terms), np.zeros((_NV, _NV)))


def _spaces() -> None:
    terms = operational_space.StackedTerms(
        M=np.eye(2)[None], g=np.zeros((1, 2)), J_s=np.array([[[1.0, 0.5]]]),
        J_t=np.array([[[0.0, 1.0]]]),
    )  # fmt: skip
    shapes = ((1, 1), (1, 1), (1, 1), (2, 1), (1,), (1, 2))
    out = operational_space.StackedSpaces(*(np.zeros((1, *shape)) for shape in shapes))
    operational_space.operational_spaces(
        tuple(terms), np.eye(1), np.array([0, 1]), operational_space.SYMMETRIC, False, 1e-10,
        tuple(out),
    )  # fmt: skip


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
    )  # fmt: skip
    newton = control_law.Newton(
        H=np.zeros((nv, nv)), moved=np.zeros((nv, 1)), slope=square, J=square.copy(),
        square=square.copy(), step=one.copy(),
    )  # fmt: skip
    memory = np.zeros(operational_space.memory_size(nv, 1, 1, 1))
    parts = (
        tree, _mounts(1, nv), tasks, gains, dynamics.allocate(tree),
        dynamics.allocate_frames(1, nv), at, newton,
    )  # fmt: skip
    raw, q = (*map(tuple, parts), memory), _upright(1)
    signal = control_law.Signal(
        kind=control_law.TANK, sag=one.copy(), iterations=1, settled=1e-12, diverged=10.0,
        position=one.copy(), theta=one.copy(), energy=np.ones(1), started=none.copy(), rate=1.0,
        delay_bound=0.0, corrected=True,
    )  # fmt: skip
    out = one.copy()
    control_law.tick(raw, tuple(signal), 1e-3, q, one, out)
    task_error.leave_to_higher(at.J_t, np.zeros((1, nv)), tasks.levels, out, np.zeros(nv))


def _plant() -> tuple[Any, ...]:
    tree, one = _tree(1), np.ones(1)
    motors = motor.Motors(*(np.ones(1) for _ in motor.Motors._fields))
    contacts = contact.Contacts(
        frame=np.zeros(1, np.int64), offset=np.zeros((1, 3)), C=np.eye(3)[None],
        anchor=np.zeros((1, 3)), friction=one, ridge=np.zeros(1), radius=np.zeros(1),
        torsion_damping=np.zeros(1), torsion_radius=np.zeros(1), load=np.zeros((0, 3)),
        closed=np.ones(1, np.int64), yielding=np.zeros(1), floor=np.zeros(1), ground_x=np.zeros(1),
        ground_z=np.zeros(1), stabilisation=50.0, stop_time=1e-3, weight=30.0,
    )  # fmt: skip
    return tuple(map(tuple, (tree, _mounts(1, _NV), motors, contacts)))


def _instant() -> contact.Instant:
    return contact.Instant(
        q=_upright(1), v=np.zeros(_NV), theta=np.zeros(1), theta_dot=np.zeros(1),
        tau_motor=np.zeros(1), tau_sea=np.zeros(1), acceleration=np.zeros(_NV),
        force=np.zeros((1, 3)), gap=np.zeros(1), position=np.zeros((1, 3)),
        velocity=np.zeros((1, 3)), power=np.zeros(4), energy=np.zeros(2),
    )  # fmt: skip


def _step() -> None:
    raw, raw_terms = _plant(), tuple(dynamics.allocate(_tree(1)))
    instants = tuple(_instant()), tuple(_instant())
    now, _ = instants
    closed, three = np.ones(1, np.int64), np.zeros((1, 3))
    contact.smallest_margin(np.eye(3)[None], closed, 1.0, three, np.zeros(1), three)
    contact.sense(now, closed, closed, 0.0, np.zeros(1 + _NQ + _NV + 3 + 2))
    books = tuple(Ledger(np.zeros((9, 1)), np.zeros(5), np.zeros(4), np.zeros(1)))
    held = plant.Held(command=np.zeros(1), known_torque=np.zeros(1), instant=True)
    plant.act(raw, raw_terms, instants, plant.STEP, tuple(held), 1e-3, books, closed, three)
    plant.update_stores(raw[2], now, books)
    motor.rate_rows(raw[2], True, np.zeros((6, 1)), np.zeros((6, 1)))
    _glide(raw, raw_terms, instants, books)


def _glide(raw: Any, raw_terms: Any, instants: Any, books: Any) -> None:
    one, none = np.zeros(1), np.zeros(0, np.int64)
    channels = run.Channels(
        due=np.zeros(0), kind=none, tick=none, samples=np.zeros((1, 20)), commands=np.zeros((1, 1)),
        sent=one, acting=one, acting_tick=np.zeros(1, np.int64), torque_known=np.zeros(0),
        torque_history=np.zeros((1, 1)), torque_held=one, storage=one, tank=one,
        undelayed_work=one,
    )  # fmt: skip
    periods = run.Periods(step=1e-3, steps=0, log=1, watch=1, torque=1, torque_period=1e-3)
    limits = run.Limits(deflection=1.0, speed=1.0, height=-1.0, tilt=-1.0, up=np.zeros((1, 3)))
    now = contact.Instant(*instants[0])
    shapes = {
        "q": now.q.shape, "v": now.v.shape, "contact_force": (1, 3), "stores": (4,),
        "joint": (9, 1), "scalar": (5,), "time": (), "tick": (), "moved": (), "storage": (),
        "tank": (),
    }  # fmt: skip
    log = run.Log(
        **{
            name: np.zeros((1, *shapes.get(name, (1,))), np.int64 if name in run.WHOLE else float)
            for name in run.Log._fields
        }
    )
    whole = tuple(channels), tuple(periods), tuple(limits), True
    run.glide(raw, raw_terms, instants, books, whole, tuple(log), (0.0, 0, 0, run.WATCH), 1.0)


def _different(kind: Any) -> tuple[float, ...]:
    """Numbers of which no two are equal, so that no difference is 0."""
    return tuple(1.0 + 0.1 * k for k in range(len(kind._fields)))


def _walk() -> None:
    tree, mounts, six, three = _tree(6), _mounts(2, 12), np.zeros(6), np.zeros(3)
    terms, q, v = tuple(dynamics.allocate(tree)), _upright(6), np.zeros(12)
    walking.quintic(three, three, 1.0, six)
    walking.quintic_at(six, 0.5, three.copy())
    two, table, body = np.zeros((2, 3)), np.zeros((6, 2, 4)), (tuple(tree), terms, tuple(mounts))
    step = walking.StepNow(old=three, new=three, height=six, offset=0.0, phase=0.1)
    gait = _different(walking.Gait)
    walking.capture_end(three, three, six[:2], tuple(step), gait, 1.0, np.zeros((2, 2)))
    plan = _different(walking.SwingPlan)
    walking.swing(np.zeros((3, 3)), three, 0.1, 1e-3, plan, 0.0, 0.1)
    walking_state.foresee(
        body, (0, 0, two), (six, table), (0.0, 1e-3, 1, 0.0, 0.0),
        (np.zeros(4), np.zeros((4, 6)), 0), q, v, np.zeros((6, 2)), six.copy(),
    )  # fmt: skip
    wish = walking_law.Reference(
        height=six, height_time=0.1, swing=np.zeros((3, 3)), phase=0.1, transfer_time=0.05,
        stance=0, still=False,
    )  # fmt: skip
    gains = _different(walking_law.Gains)
    walking_law.law(body[1:], v, v, tuple(wish), gains, six.copy(), six.copy())
    walking_law.carry(six, six, six.copy(), six, six, six, six, gains[:4], six.copy())
