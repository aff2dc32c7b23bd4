"""Contact and rigid-body kernels against Pinocchio and plain NumPy."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

from helpers.kernels import from_python
from sealag.kernels import contact, friction, linalg, spatial
from sealag.whole_body import Measurement

FEET = ("left_foot", "right_foot")
SOLVE, SETTLE = from_python(friction.solve), from_python(friction.settle)
PROJECT, CHOLESKY = from_python(contact.project), from_python(linalg.cholesky)
WRITE_MEASUREMENT = from_python(contact.write_measurement)
INTEGRATE, TANGENT_RATE = from_python(spatial.integrate), from_python(spatial.tangent_rate)


class Feet(NamedTuple):
    """What a measurement reads of the contacts."""

    closed: np.ndarray
    frame: np.ndarray


class TestManifold:
    @pytest.mark.parametrize("size", [1e-5, 1e-2, 1.5])
    def test_integrate(self, hume, size):
        rng = np.random.default_rng(0)
        for _ in range(20):
            q = pin.randomConfiguration(hume._model, np.full(13, -1.0), np.full(13, 1.0))
            u, out = size * rng.normal(size=12), np.empty(13)
            INTEGRATE(q, u, 6, out)
            expected = pin.integrate(hume._model, q, u)
            if expected[3:7] @ out[3:7] < 0:
                expected[3:7] *= -1
            np.testing.assert_allclose(out, expected, atol=1e-14 * max(1, 1 / size))

    def test_tangent_rate(self, hume):
        """Along q0 + u(t) the velocity is v: as Pinocchio differentiates it."""
        rng = np.random.default_rng(1)
        for size, tolerance in ((1e-2, 1e-9), (1e-1, 1e-5)):
            u, v, out = size * rng.normal(size=12), rng.normal(size=12), np.empty(12)
            TANGENT_RATE(u, v, 6, out)
            _, J = pin.dIntegrate(hume._model, hume.neutral(), u)
            np.testing.assert_allclose(J @ out, v, atol=tolerance)


def test_a_measurement_row():
    """Time, q, v, motor angles and speeds, spring torques and loaded feet lie where they belong."""
    rng = np.random.default_rng(3)
    shapes = dict.fromkeys(contact.Instant._fields, (1,)) | {
        "q": (8,), "v": (7,), "acceleration": (7,), "force": (3, 3), "position": (3, 3),
        "velocity": (3, 3), "gap": (3,), "power": (4,), "energy": (2,),
    }  # fmt: skip
    now = contact.Instant(**{name: rng.normal(size=shape) for name, shape in shapes.items()})
    row = np.full(1 + 8 + 7 + 3 + 2, np.nan)
    WRITE_MEASUREMENT(now, Feet(closed=np.array([0, 1, 0]), frame=np.array([0, 0, 1])), 0.5, row)
    seen = Measurement.allocate(nq=8, nv=7, n=1, contacts=2)
    seen.data[:] = row
    assert seen.time == 0.5
    for name in ("q", "v", "theta", "theta_dot", "tau_sea"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(now, name))
    np.testing.assert_array_equal(seen.contact, [1.0, 0.0])


def _instant(hume, q, v):
    """All terms of an instant: mass matrix, bias, and point Jacobians of both feet."""
    workspace = hume.workspace()
    workspace.update(q, v)
    J = np.stack([workspace.frame_jacobian(f).copy() for f in FEET])
    R, p = map(np.stack, zip(*[[x.copy() for x in workspace.frame_placement(f)] for f in FEET]))
    drift = np.stack([workspace.frame_bias(f).copy() for f in FEET])
    return workspace.M.copy(), workspace.nle.copy(), (J, R, p, drift)


def _equations(M, right, J, C, target, closed):
    eq = friction.allocate_equations(len(M), len(closed), 0)
    assert CHOLESKY(M, eq.L)
    PROJECT(eq.L, J, C, closed, eq.rows)
    eq.free[:], eq.target[:] = np.linalg.solve(eq.L, right), target
    return eq


def _surfaces(mu):
    count = len(mu)
    return friction.Surfaces(
        foot=np.zeros(count, np.int64), friction=mu, ridge=np.full(count, 1e-11),
        torsion_damping=np.zeros(0), torsion_radius=np.zeros(0),
    )  # fmt: skip


def _solve(M, right, J, C, target, closed, mu):
    eq = _equations(M, right, J, C, target, closed)
    x, force, yielding = np.zeros(len(M)), np.zeros((len(closed), 3)), np.zeros(len(closed))
    assert SOLVE(eq, _surfaces(mu), closed, yielding, x, force)
    return x, force, yielding


def _draw(hume, seed):
    rng = np.random.default_rng(seed)
    q = hume.configuration(
        rng.uniform(-0.5, 0.5, 6), base_position=rng.normal(size=3),
        base_quaternion=rng.normal(size=4),
    )  # fmt: skip
    v = rng.normal(size=12)
    M, nle, (J, _, _, drift) = _instant(hume, q, v)
    right = np.concatenate([np.zeros(6), 20 * rng.normal(size=6)]) - nle
    return q, v, M, right, J, drift


@pytest.mark.parametrize("seed", range(5))
def test_sticking_equals_pinocchio_s_constraint_dynamics(hume, seed):
    q, v, M, right, J, drift = _draw(hume, seed)
    model = hume._model
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for foot in FEET:
        frame = model.frames[model.getFrameId(foot)]
        one = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, model, frame.parentJoint, frame.placement,
            pin.LOCAL_WORLD_ALIGNED,
        )  # fmt: skip
        models.append(one)
        datas.append(one.createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, models, datas)
    tau = right + pin.nonLinearEffects(model, model.createData(), q, v)
    expected = pin.constraintDynamics(model, data, q, v, tau, models, datas)
    x, _, _ = _solve(M, right, J[:, :3].copy(), np.tile(np.eye(3), (2, 1, 1)), drift[:, :3].copy(),
                     np.ones(2, np.int64), np.full(2, np.inf))  # fmt: skip
    np.testing.assert_allclose(x, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", range(30))
def test_friction_law_holds(hume, seed):
    """Stick inside the cone, or slide on it against the velocity that follows."""
    _, _, M, right, J, drift = _draw(hume, seed)
    rng = np.random.default_rng(seed)
    right[2] -= 400.0  # press the feet down
    target = drift[:, :3] + 1e3 * rng.normal(size=(2, 3)) * [0.3, 0.3, 0.0]
    mu, closed = np.full(2, 0.4), np.ones(2, np.int64)
    x, force, _ = _solve(
        M, right, J[:, :3].copy(), np.tile(np.eye(3), (2, 1, 1)), target, closed, mu
    )
    left = J[:, :3] @ x + target
    np.testing.assert_allclose(left[:, 2], 0, atol=1e-5)
    np.testing.assert_allclose(
        M @ x - right - np.einsum("pac,pa->c", J[:, :3], force), 0, atol=1e-6
    )
    if (force[:, 2] < 0).any():
        return  # such a point opens: settle's business
    for w, f in zip(left[:, :2], force[:, :2]):
        limit = 0.4 * force[np.flatnonzero((force[:, :2] == f).all(axis=1))[0], 2]
        if np.linalg.norm(w) < 1e-5:
            assert np.linalg.norm(f) <= limit * (1 + 1e-8)
        else:
            np.testing.assert_allclose(np.linalg.norm(f), limit, rtol=1e-7)
            np.testing.assert_allclose(f, -limit * w / np.linalg.norm(w), rtol=1e-4, atol=1e-4)


def test_sliding_force_dissipates_most_for_one_point():
    """A ball on a plane: friction is the force in the disk that leaves the least speed."""
    M, J = np.diag([2.0, 3.0, 1.0]), np.eye(3)[None]
    right, target = np.array([5.0, -4.0, -9.0]), np.array([[700.0, 300.0, 0.0]])
    _, force, _ = _solve(M, right, J, np.eye(3)[None], target, np.ones(1, np.int64),
                         np.full(1, 0.5))  # fmt: skip
    assert force[0, 2] == pytest.approx(9.0)

    def energy(f):
        w = (right[:2] + f) / np.diag(M)[:2] + target[0, :2]
        return 0.5 * w @ (np.diag(M)[:2] * w)

    disk = {"type": "ineq", "fun": lambda f: 4.5**2 - f @ f}
    best = minimize(energy, [0.0, 0.0], constraints=disk, tol=1e-12).x
    np.testing.assert_allclose(force[0, :2], best, atol=1e-4)


def test_settle_opens_what_pulls():
    """A bar on two points, lifted at one end: only the other end stays on the ground."""
    M = np.diag([1.0, 0.1])
    J = np.zeros((2, 3, 2))
    J[:, 2] = [[1.0, -0.5], [1.0, 0.5]]
    closed, mask = np.ones(2, np.int64), np.ones(2, np.int64)
    eq = _equations(
        M, np.array([-9.81, 20.0]), J, np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), closed
    )
    x, force = np.zeros(2), np.zeros((2, 3))
    status = SETTLE(eq, _surfaces(np.zeros(2)), mask, closed, np.zeros(2), 1e-9, x, force)
    assert status == friction.SETTLED
    np.testing.assert_array_equal(closed, [1, 0])
    assert force[0, 2] > 0
    assert (J[1, 2] @ x) > 0
