"""Controllers with filters, frozen as they tick: the characteristic equation of one joint in closed
form, and a simulation of the sampled loop event by event. Neither shares code with sealag."""

import cmath
import heapq
import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import sealag
from helpers.chains import wheel
from sealag.actuation import Actuators

LINK, MOTOR, SPRING, DRAG = 0.3, 0.1, 300.0, 0.5
KP, KD, CUT = 100.0, 3.0, 200.0
PERIOD = 1e-3


@pytest.fixture
def joint(tmp_path):
    """A wheel on a spring with its motor: no gravity."""
    robot = wheel(tmp_path, inertia=LINK)
    motor = Actuators.of(
        robot.joints, spring_stiffness=SPRING, rotor_inertia=MOTOR, inertia_shaping=1.0,
        motor_damping=DRAG,
    )  # fmt: skip
    return robot, motor


class Filtered:
    """PD on the motor's angle and its filtered rate."""

    keep = math.exp(-CUT * PERIOD)

    def reset(self, t, measurement):
        self.rate = measurement.theta_dot.copy()

    def tick(self, t, measurement, out):
        out[:] = -KP * measurement.theta - KD * self.rate
        self.rate = self.keep * self.rate + (1.0 - self.keep) * measurement.theta_dot


class Difference:
    """PD that takes the rate from two angles."""

    def reset(self, t, measurement):
        self.last = measurement.theta.copy()

    def tick(self, t, measurement, out):
        out[:] = -KP * measurement.theta - KD * (measurement.theta - self.last) / PERIOD
        self.last = measurement.theta.copy()


def answer_of(kind, z):
    """Torque of the motor's angle with z = e^{sT}, its rate given by s; sign left out."""
    s = cmath.log(z) / PERIOD
    if kind is Difference:
        return KP + KD * (1.0 - 1.0 / z) / PERIOD
    return KP + KD * s * (1.0 - Filtered.keep) / (z - Filtered.keep)


def margin_of(response):
    """First delay at which 1 + P(jω) K(jω) e^{−jωd} = 0: where |P K| = 1, by its phase."""

    def loop(w):
        s = 1j * w
        link = LINK * s * s + SPRING
        plant = link / (link * (MOTOR * s * s + DRAG * s + SPRING) - SPRING**2)
        return plant * response(s)

    grid = np.geomspace(0.5, 1000.0, 20001)
    size = np.array([math.log(abs(loop(w))) for w in grid])
    crossings = [
        brentq(lambda w: math.log(abs(loop(w))), grid[i], grid[i + 1])
        for i in np.flatnonzero(size[:-1] * size[1:] < 0.0)
    ]
    return min(((cmath.phase(loop(w)) + math.pi) % (2.0 * math.pi)) / w for w in crossings)


def bilinear(kind):
    """The discrete answer where z = (1 + sT/2) / (1 − sT/2); rates are given by s itself."""

    def response(s):
        z = (1.0 + s * PERIOD / 2.0) / (1.0 - s * PERIOD / 2.0)
        if kind is Difference:
            return answer_of(kind, z)
        return KP + KD * s * (1.0 - Filtered.keep) / (z - Filtered.keep)

    return response


@pytest.mark.parametrize("kind", [Filtered, Difference])
def test_the_frozen_margin_is_that_of_the_characteristic_equation(kind, joint):
    robot, motor = joint
    found = sealag.freeze(kind(), robot, motor, q=np.zeros(1), period=PERIOD)
    assert found.memory > 0.5
    assert found.unexplained < 1e-5
    assert found.bend < 1e-6
    assert found.loop.memory == 1
    assert found.loop.margin().delay == pytest.approx(margin_of(bilinear(kind)), rel=1e-5)


def simulated(kind, delay, periods):
    """|x| at each sample of the joint under the controller itself, commands late and held."""
    A = np.array([
        [0.0, 1.0, 0.0, 0.0], [-SPRING / LINK, 0.0, SPRING / LINK, 0.0],
        [0.0, 0.0, 0.0, 1.0], [SPRING / MOTOR, 0.0, -SPRING / MOTOR, -DRAG / MOTOR],
    ])  # fmt: skip
    both = np.zeros((5, 5))
    both[:4, :4], both[3, 4] = A, 1.0 / MOTOR
    x, u, t, waiting, sizes = np.array([0.1, 0.0, 0.1, 0.0]), 0.0, 0.0, [], []
    last, rate = x[2], x[3]
    for k in range(periods):
        sizes.append(float(np.linalg.norm(x * [1.0, 0.05, 1.0, 0.05])))
        if kind is Difference:
            command = -KP * x[2] - KD * (x[2] - last) / PERIOD
            last = x[2]
        else:
            command = -KP * x[2] - KD * rate
            rate = Filtered.keep * rate + (1.0 - Filtered.keep) * x[3]
        heapq.heappush(waiting, (k * PERIOD + delay, command))
        end = (k + 1) * PERIOD
        while t < end:
            due = min(waiting[0][0], end) if waiting else end
            x, t = (expm(both * (due - t)) @ np.append(x, u))[:4], due
            if due < end:
                u = heapq.heappop(waiting)[1]
    return np.array(sizes)


@pytest.mark.parametrize("kind", [Filtered, Difference])
def test_the_sampled_margin_is_where_a_simulation_begins_to_grow(kind, joint):
    robot, motor = joint
    loop = sealag.freeze(kind(), robot, motor, q=np.zeros(1), period=PERIOD).loop
    margin = loop.sampled_margin(PERIOD)
    for share, grows in ((0.97, False), (1.03, True)):
        sizes = simulated(kind, share * margin.delay, 3000)
        assert (sizes[-500:].max() > sizes[1000:1500].max()) == grows
    assert loop.sampled_radius(PERIOD, 0.99 * margin.delay) < 1.0
    assert loop.sampled_radius(PERIOD, 1.01 * margin.delay) > 1.0
    with pytest.raises(sealag.SealagError, match="other rates"):
        loop.sampled_margin(2.0 * PERIOD)
