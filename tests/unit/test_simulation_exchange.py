"""No age in any run exceeds d_1, and constant delays attain it exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.chains import wheel
from helpers.controllers import JointPD
from sealag.actuation import Actuators
from sealag.delay import (
    Constant,
    Delays,
    Link,
    PacketOrder,
    RoundTrip,
    Sinusoid,
    Table,
)
from sealag.simulation import Clock, Network, closed_loop

CENTRAL = 2e-3

signals = st.one_of(
    st.builds(Constant, st.floats(0, 0.02)),
    st.builds(
        Sinusoid,
        mean=st.floats(0.005, 0.02),
        amplitude=st.floats(0, 0.005),
        angular_frequency=st.floats(1, 500),
    ),
    st.builds(
        lambda delay: Table(time=0.01 * np.arange(len(delay)), delay=np.array(delay)),
        st.lists(st.floats(0, 0.02), min_size=1, max_size=30),
    ),
    st.builds(
        lambda seed: Table.measured(np.random.default_rng(seed).uniform(0, 0.02, 60), period=2e-3),
        st.integers(0, 9),
    ),
)
links = st.builds(
    Link,
    delay=signals,
    jitter=st.one_of(st.just(0.0), st.floats(0, 0.01)),
    loss=st.one_of(st.just(0.0), st.floats(0, 0.6)),
    max_burst=st.integers(1, 4),
    order=st.sampled_from(list(PacketOrder)),
)
constants = st.builds(
    lambda value: Link(delay=Constant(value)),
    st.one_of(st.just(0.0), st.floats(0, 0.02), st.sampled_from([1e-3, 2e-3, 5e-3])),
)


def _delays(up, down, drive, embedded=0.0):
    return Delays(
        central=RoundTrip(up=up, down=down),
        embedded=RoundTrip(up=Link(delay=Constant(0.3)), down=drive),
        sample_time=CENTRAL,
        embedded_period=embedded,
    )


def _ages(delays, seed=0, duration=0.4):
    clock = Clock(physics=1e-3, central=delays.sample_time, embedded=delays.embedded_period)
    network = Network.from_delays(delays)
    assert network.delay_bound(clock) == pytest.approx(delays.d_1, rel=1e-12)
    return network.plan(clock, duration=duration, seed=seed).ages(duration)


@settings(max_examples=600, deadline=None)
@given(up=links, down=links, drive=links, seed=st.integers(0, 99),
       embedded=st.sampled_from([0.0, 1e-3, 2e-3]))  # fmt: skip
def test_no_age_exceeds_its_bound(up, down, drive, embedded, seed):
    delays = _delays(up, down, drive, embedded)
    ages = _ages(delays, seed)
    assert ages.total <= delays.d_1 + 1e-12
    assert ages.command <= delays.d_2 + 1e-12
    assert ages.measurement <= delays.d_1 - delays.d_2 + 1e-12


@settings(max_examples=200, deadline=None)
@given(up=constants, down=constants, drive=constants)
def test_constant_delays_attain_their_bound(up, down, drive):
    delays = _delays(up, down, drive)
    ages = _ages(delays)
    assert ages.total == pytest.approx(delays.d_1, abs=1e-12)
    assert ages.command == pytest.approx(delays.d_2, abs=1e-12)
    assert ages.measurement == pytest.approx(delays.d_1 - delays.d_2, abs=1e-12)


def test_a_continuous_controller_runs_with_a_period_that_counts():
    """0 ms everywhere: what runs holds its command for a period, and `sampled` says so."""
    none = Constant(0.0)
    ideal = Delays(central=none, embedded=none)
    assert ideal.d_1 == 0.0
    runs = ideal.sampled()
    assert runs.d_1 == runs.sample_time == 1e-3
    assert _ages(runs).total == pytest.approx(runs.d_1, abs=1e-12)
    assert Delays(central=none, embedded=none, embedded_period=5e-4).sampled().sample_time == 5e-4
    assert runs.sampled() == runs


def test_losses_on_both_ways_down_add_up():
    """The bound with both bursts is attained nearly, and one burst less would not do."""
    lossy = Link(delay=Constant(1e-3), loss=0.7, max_burst=2)
    delays = _delays(Link(delay=Constant(0.0)), lossy, lossy)
    worst = max(_ages(delays, seed, duration=2.0).command for seed in range(20))
    assert delays.d_2 == pytest.approx(2e-3 + CENTRAL + 4 * CENTRAL)
    assert delays.d_2 - CENTRAL + 1e-12 < worst <= delays.d_2 + 1e-12


def test_links_are_the_delays_own():
    """Field by field: up is up, and the torque's way up is simulated only where it is declared."""
    way = {name: Link(delay=Constant(k * 1e-3)) for k, name in enumerate("abcd", start=1)}
    ways = {
        "central": RoundTrip(up=way["a"], down=way["b"]),
        "embedded": RoundTrip(up=way["c"], down=way["d"]),
        "sample_time": CENTRAL,
    }
    network = Network.from_delays(Delays(**ways, delayed_torque_feedback=True))
    assert (network.central_up, network.central_down) == (way["a"], way["b"])
    assert (network.embedded_up, network.embedded_down) == (way["c"], way["d"])
    assert Network.from_delays(Delays(**ways)).embedded_up is None
    plan = network.plan(Clock(physics=1e-3, central=CENTRAL), duration=0.1, seed=0)
    np.testing.assert_allclose((plan.tick - plan.seen)[5:], 1e-3)
    np.testing.assert_allclose(plan.taken - plan.tick[plan.command], 6e-3)
    middle = 1e-3 * np.arange(len(plan.torque)) + 0.5e-3
    np.testing.assert_allclose((middle - plan.torque)[5:], 3e-3)


def test_ages_do_not_depend_on_where_the_run_ends():
    """From the first full hold on: 0.4 of a period more or less changes nothing."""
    delays = _delays(*(Link(delay=Constant(d)) for d in (1.3e-3, 2.1e-3, 0.7e-3)))
    clock, network = Clock(physics=1e-4, central=CENTRAL), Network.from_delays(delays)
    plan = network.plan(clock, duration=0.1, seed=0)
    ends = np.linspace(0.02, 0.1, 201)
    assert np.ptp([plan.ages(end).total for end in ends]) < 1e-12
    assert plan.ages(0.004).total < 0.9 * delays.d_1  # not yet full


class _Recorder(JointPD):
    """Keeps what it was told and what it answered."""

    def reset(self, t, measurement):
        self.rows = []

    def tick(self, t, measurement, out):
        super().tick(t, measurement, out)
        self.rows.append((t, measurement.data[0], measurement.theta[0], out[0]))


def _run(folder, delays, physics):
    robot = wheel(folder)
    springs = Actuators.of(
        robot.joints, spring_stiffness=350.0, rotor_inertia=0.1, motor_damping=10.0,
        inertia_shaping=0.5,
    )  # fmt: skip
    controller = _Recorder(np.zeros(1), stiffness=40.0, motor=True)
    run = closed_loop(
        robot, springs, controller, q=np.array([0.3]), theta=np.array([0.25]), duration=0.1,
        clock=Clock(
            physics=physics, central=CENTRAL, embedded=delays.embedded_period, log=physics
        ),
        network=Network.from_delays(delays),
    )  # fmt: skip
    return run, np.array(controller.rows)


ODD = (1.37e-3, 2.61e-3, 0.43e-3)


def test_the_state_that_arrives_is_that_of_the_instant_it_was_sent(tmp_path):
    """Delays that no step divides: the angle of exactly 1.37 ms ago, obeyed exactly when due."""
    delays = _delays(*(Link(delay=Constant(d)) for d in ODD))
    run, told = _run(tmp_path, delays, 1e-4)
    told = told[3:]
    np.testing.assert_allclose(told[:, 0] - told[:, 1], ODD[0], rtol=1e-12)
    at = np.searchsorted(run.time, told[:, 1], "right") - 1
    ahead = told[:, 1] - run.time[at]
    linear = run.theta[at, 0] + ahead * run.theta_dot[at, 0]
    np.testing.assert_allclose(told[:, 2], linear, atol=1e-6)
    assert np.abs(told[:, 2] - run.theta[at, 0]).max() > 1e-5
    for tick, _, _, command in told[:-4]:
        taken = tick + ODD[1] + ODD[2]
        here = (run.time > taken + 1e-9) & (run.time < taken + CENTRAL - 1e-9)
        np.testing.assert_array_equal(run.tau_osc[here, 0], command)
    assert run.ages.total == pytest.approx(delays.d_1, abs=1e-12)


def test_a_run_hardly_depends_on_whether_its_steps_divide_its_delays(tmp_path):
    """Fourth order with split steps: the motion is that of the same delays on a fine grid."""
    delays = _delays(*(Link(delay=Constant(d)) for d in ODD))
    ends = [_run(tmp_path, delays, CENTRAL / k)[0].theta[-1, 0] for k in (1, 2, 3, 16)]
    errors = np.abs(np.array(ends[:-1]) - ends[-1])
    print(errors)
    assert errors.max() < 1e-9
    late = _delays(*(Link(delay=Constant(d + 1e-5)) for d in ODD))
    assert abs(_run(tmp_path, late, CENTRAL / 16)[0].theta[-1, 0] - ends[-1]) > 5e-7


def test_delayed_torque_feedback_is_late_by_its_way_up(tmp_path):
    """Second order in the step: no step is added to its way up."""

    def end(physics, way):
        none = Link(delay=Constant(0.0))
        delays = Delays(
            central=RoundTrip(up=none, down=none),
            embedded=RoundTrip(up=Link(delay=Constant(way)), down=none),
            sample_time=CENTRAL,
            delayed_torque_feedback=True,
        )
        return _run(tmp_path, delays, physics)[0].theta[-1, 0]

    fine = end(CENTRAL / 64, 3e-3)
    errors = [abs(end(CENTRAL / k, 3e-3) - fine) for k in (4, 8)]
    print(errors)
    assert errors[0] / errors[1] > 3
    assert abs(end(CENTRAL / 64, 3e-3 + CENTRAL / 8) - fine) > 4 * errors[1]
