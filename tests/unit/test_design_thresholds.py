"""A design is certified up to its bound and not beyond; runs take the project's numbers."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system, constant_delays, joint_task
from sealag.whole_body import GravityCompensation, Law, MotorAngles


def held(folder, **delays):
    arm = arm_system(folder)
    law = Law(
        tasks=(joint_task(arm.robot, 80.0),),
        stiffness_form="force",
        gravity=GravityCompensation.PLANNED,
        signal=MotorAngles(),
    )
    return replace(arm, law=law, **delays)


@pytest.mark.parametrize(("share", "status"), [(0.9999, "certified"), (1.0001, "not_certified")])
def test_a_delay_is_certified_up_to_the_bound_and_not_beyond(share, status, tmp_path):
    """Each motor sees its own k: d ≤ min D/k = 5/80 s."""
    bound = 5.0 / 80.0
    period = 1e-3
    late = constant_delays(0.0, share * bound - period, sample_time=period)
    answer = sealag.certify(held(tmp_path, delays=late)).answer
    assert answer.max_delay_s == pytest.approx(bound, rel=1e-6)
    assert answer.status == status
    assert bool(answer.reasons) == (status == "not_certified")


def test_a_tracked_reference_has_the_project_s_amplitude_and_frequency(tmp_path):
    """One whole period: the first joint goes out by the amplitude and comes back."""
    system = held(tmp_path)
    setting = system.simulation.model_copy(
        update={"track_amplitude": 0.05, "track_frequency_hz": 0.5}
    )
    run = sealag.simulate(replace(system, simulation=setting), scenario="track", duration=2.0)
    moved = run.q[:, 0] - run.q[0, 0]
    assert moved[len(moved) // 2] == pytest.approx(0.05, rel=0.25)
    assert abs(moved[-1]) < 0.2 * 0.05


def test_a_tracked_reference_feeds_its_own_speed_forward(tmp_path):
    """Without D_θ θ̇_d the first motor would lag by D ẋ / k, out and back; with it, hardly."""
    system = held(tmp_path)
    setting = system.simulation.model_copy(
        update={"track_amplitude": 0.05, "track_frequency_hz": 0.5}
    )
    run = sealag.simulate(replace(system, simulation=setting), scenario="track", duration=2.0)
    out, back = (run.theta[int(np.abs(run.time - t).argmin()), 0] for t in (0.5, 1.5))
    speed = 0.5 * 0.05 * 2.0 * np.pi * 0.5
    lag = 12.0 * speed / 80.0
    assert abs(back - out) < 0.2 * (2.0 * lag)


def test_a_drop_begins_at_the_project_s_height():
    system = sealag.load(EXAMPLES / "anymal.toml")
    setting = system.simulation.model_copy(update={"drop_height": 0.07})
    starts = [
        sealag.simulate(one, scenario=kind, duration=0.01).q[0, 2]
        for one, kind in ((system, "regulate"), (replace(system, simulation=setting), "drop"))
    ]
    assert starts[1] - starts[0] == pytest.approx(0.07, abs=1e-6)


def test_the_log_period_is_what_is_asked_for(tmp_path):
    system = held(tmp_path)
    every = sealag.simulate(system, duration=0.1, log_period=0.02)
    np.testing.assert_allclose(np.diff(every.time), 0.02, rtol=1e-9)
    setting = system.simulation.model_copy(update={"log_period_ms": 50.0})
    stated = sealag.simulate(replace(system, simulation=setting), duration=0.1)
    np.testing.assert_allclose(stated.time, [0.0, 0.05, 0.1], rtol=1e-9)


def test_a_balanced_design_without_pushes_gets_a_twentieth_of_its_weight_for_a_tenth(tmp_path):
    """∫F dx of the last joint's frame between 0.2 s and 0.3 s."""
    system = held(tmp_path)
    run = sealag.simulate(system, scenario="balance", duration=0.35)
    first, last = (int(np.abs(run.time - t).argmin()) for t in (0.2, 0.3))
    places = [system.robot.frame_placement("joint1", run.q[at])[1][0] for at in (first, last)]
    given = run.audit.scalar_flows["disturbance"]
    work = 0.05 * system.robot.weight * (places[1] - places[0])
    assert work > 1e-4
    assert given[last] == pytest.approx(work, rel=1e-6)
    assert given[first] == 0.0
    assert given[-1] == given[last]


@pytest.mark.parametrize("radius", [0.0, 0.035])
def test_a_design_stands_on_feet_of_the_project_s_radius(radius):
    system = sealag.load(EXAMPLES / "anymal.toml")
    setting = system.simulation.model_copy(update={"foot_radius": radius})
    run = sealag.simulate(replace(system, simulation=setting), scenario="regulate", duration=0.01)
    for contact in system.contacts:
        height = system.robot.frame_placement(contact.frame, run.q[0])[1][2]
        assert height == pytest.approx(radius, abs=1e-9)
