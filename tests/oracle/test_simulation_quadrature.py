"""Each joule that a run prints is within its stated tolerance of a dense quadrature of its motion.

The same run is logged at its control period and 16 times as finely; the fine log is integrated here
by Simpson's rule between the instants at which the drives take a command.
"""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from helpers.chains import chain
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.simulation import Clock, Network, Push, Scene, closed_loop

PERIOD, FINE, DURATION = 2e-3, 2e-3 / 16, 0.4
COULOMB = np.array([0.11, 0.07, 0.05])


class Pendulums:
    """τ = −∂V/∂θ of V = Σ k (1 − cos(θ − a)) + ½ c (θ_1 − θ_2)², and a part without potential."""

    k, a, c = np.array([30.0, 20.0, 12.0]), np.array([0.2, -0.1, 0.4]), 6.0

    def __init__(self, curl=0.0):
        self.curl = curl

    def reset(self, t, measurement):
        """Nothing to forget."""

    def tick(self, t, measurement, out):
        out[:] = self.command(measurement.theta, measurement.q_joint)

    def command(self, theta, q):
        tau = -self.k * np.sin(theta - self.a)
        tau[:2] -= self.c * (theta[0] - theta[1]) * np.array([1.0, -1.0])
        return tau + self.curl * np.array([q[1] * theta[2], -(q[2] ** 2), q[0]])

    def storage(self, t, measurement, command):
        self.tick(t, measurement, command)
        theta = measurement.theta
        coupling = self.c / 2 * (theta[0] - theta[1]) ** 2
        return float(self.k @ (1 - np.cos(theta - self.a)) + coupling)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    robot = chain(tmp_path_factory.mktemp("arm"), count=3, length=0.3)
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=[350.0, 220.0, 140.0],
        rotor_inertia=[0.09, 0.05, 0.03],
        inertia_shaping=[0.5, 1.5, 0.8],
        motor_damping=[3.0, 2.0, 1.0],
        spring_damping=[0.3, 0.2, 0.4],
        coulomb_friction=COULOMB,
        viscous_friction=[0.2, 0.1, 0.3],
    )
    return robot, springs


def _run(arm, log, curl=0.0, fine=FINE):
    robot, springs = arm
    late = (3e-3, 3.5e-3, 2e-3)
    network = Network(
        **{
            name: Link(delay=Constant(delay))
            for name, delay in zip(("central_up", "central_down", "embedded_down"), late)
        }
    )
    q = np.array([0.5, -0.4, 0.3])
    return closed_loop(
        robot, springs, Pendulums(curl), q=q, theta=q + np.array([0.05, 0.02, -0.03]),
        v=np.array([1.0, -2.0, 0.5]), duration=DURATION,
        clock=Clock(physics=fine, central=PERIOD, log=log), network=network,
        scene=Scene(
            pushes=[Push(frame="link2", force=(8.0, 0.0, 3.0), start=0.05, duration=0.15)]
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def runs(arm):
    return {curl: (_run(arm, PERIOD, curl), _run(arm, FINE, curl)) for curl in (0.0, 3.0)}


def _integral(run, power):
    """∫power of a fine log (N, …), piece by piece between takings 0.5 ms after every tick."""
    pieces = np.arange(0, len(run.time), 4)  # 0.5 ms
    total = np.zeros_like(power)
    for first in pieces[:-1]:
        rows = slice(first, first + 5)
        piece = cumulative_simpson(power[rows], x=run.time[rows], axis=0, initial=0.0)
        total[rows] = total[first] + piece
    return total


@pytest.mark.parametrize("curl", [0.0, 3.0])
def test_what_delay_and_law_give(runs, curl):
    coarse, fine = runs[curl]
    np.testing.assert_allclose(coarse.q, fine.q[::16], atol=1e-12)
    law = Pendulums(curl)
    now = np.array([law.command(theta, q) for theta, q in zip(fine.theta, fine.q)])
    given = _integral(fine, now * fine.theta_dot).sum(axis=1)[::16]
    command = coarse.audit.joint_flows["command"].sum(axis=1)
    stored = law.k @ (1 - np.cos(fine.theta - law.a)).T
    stored += law.c / 2 * (fine.theta[:, 0] - fine.theta[:, 1]) ** 2
    stored = (stored - stored[0])[::16]
    wrong = np.abs(coarse.audit.delay_injection - (command - given))
    tolerance = coarse.audit.injection_error
    print(curl, wrong.max(), tolerance, np.abs(coarse.audit.delay_injection).max())
    assert wrong.max() <= tolerance + 1e-9
    assert tolerance < 1e-3 * np.abs(coarse.audit.delay_injection).max()
    assert np.abs(coarse.audit.law_injection - given - stored).max() <= tolerance + 1e-9
    largest = np.abs(coarse.audit.law_injection).max()
    assert (largest > 100 * tolerance) == (curl > 0.0)  # a potential gives nothing
    # a log that is finer says the same, within a smaller tolerance
    again = np.abs(fine.audit.delay_injection[::16] - coarse.audit.delay_injection)
    assert again.max() <= tolerance + 1e-9
    assert fine.audit.injection_error < 0.1 * tolerance


def test_the_statement_does_not_depend_on_the_log(arm):
    """Logged at every fifth period only: the controller is asked at every tick all the same."""
    often, seldom = _run(arm, PERIOD, 3.0, PERIOD / 4), _run(arm, 5 * PERIOD, 3.0, PERIOD / 4)
    assert seldom.audit.injection_error == pytest.approx(often.audit.injection_error)
    for name in ("delay_injection", "law_injection"):
        np.testing.assert_allclose(
            getattr(seldom.audit, name), getattr(often.audit, name)[::5], rtol=0, atol=1e-12
        )


def test_what_the_delay_stores(runs):
    """V_4 of a delay that no period divides, against its double integral; and the tolerance."""
    coarse, fine = runs[0.0]
    Y, delay = np.diag([3.0, 2.0, 1.0]) + 0.3, 0.0333
    stored, error = coarse.delay_storage(Y, delay=delay)
    power = np.einsum("ki,ij,kj->k", fine.theta_dot, Y, fine.theta_dot)

    def exact(t):
        ages = np.linspace(0.0, min(delay, t), 4001)  # the motors rested before the start
        late = np.interp(t - ages, fine.time, power)
        return np.trapezoid((delay - ages) * late, ages) / (2 * delay)

    dense = np.array([exact(t) for t in coarse.time])
    wrong = np.abs(stored - dense)
    print(wrong.max(), error, stored.max())
    assert wrong.max() <= error
    assert error < 1e-3 * stored.max()
    assert stored[0] == 0.0
    rounded, _ = coarse.delay_storage(Y, delay=0.034)
    assert np.abs(rounded - dense).max() > 10 * error  # what rounding d would do


def test_works_of_every_mechanism(runs, arm):
    """Per joint, so that an entry of another joint, or B for B_s, would be seen."""
    springs = arm[1]
    coarse, fine = runs[3.0]
    audit, D_s = coarse.audit, springs.spring_damping
    rate, link = fine.theta_dot, fine.v
    powers = {
        "port": fine.tau_sea * link,
        "shaft": fine.tau_sea * rate,
        "damping": springs.motor_damping * rate**2,
        "viscous": springs.viscous_friction * rate**2,
        "coulomb": COULOMB * np.abs(rate),
        "spring_damping": D_s * (rate - link) ** 2,
    }
    for name, power in powers.items():
        dense = _integral(fine, power)[::16]
        apart = np.abs(audit.joint_flows[name] - dense).max(axis=0)
        size = np.abs(dense).max(axis=0)
        print(name, apart / size)
        assert (apart < 1e-4 * size).all(), name
        assert size.min() > 1e-5, name
        for other in range(3):  # negative control: no joint's work is another's
            assert abs(size[other] - size[other - 1]) > 1e-2 * size[other], name
    ratio = springs.rotor_inertia / springs.shaped_inertia
    drive = audit.joint_flows["command"] - audit.joint_flows["damping"]
    shaping = (audit.joint_flows["motor_work"] - ratio * drive).sum(axis=1)
    np.testing.assert_allclose(audit.inertia_shaping, shaping, atol=1e-14)
    # Torque feedback's own work: the motor torque less B/B_s (τ_osc − D θ̇) is (1 − B/B_s) τ_sea.
    fed_back = ((1 - ratio) * audit.joint_flows["shaft"]).sum(axis=1)
    np.testing.assert_allclose(shaping, fed_back, atol=1e-9)
    assert np.abs(shaping).max() > 1e-2
    kinetic = 0.5 * (rate**2 @ springs.rotor_inertia)[::16]
    np.testing.assert_allclose(audit.stores["motor"], kinetic, rtol=1e-12)
    assert audit.closure < 1e-6
