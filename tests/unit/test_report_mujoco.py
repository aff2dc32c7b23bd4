"""Designs for MuJoCo: steps that make delays exact, and sentences where none can."""

import sys
import tomllib
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.mimics import MIMICS, joint, link, robot
from helpers.small_systems import arm_system, constant_delays
from sealag.actuation import Actuators
from sealag.delay import Constant, Delays, Link, RoundTrip, Sinusoid, Table
from sealag.errors import InputError
from sealag.export import MujocoModel
from sealag.simulation import Clock, Network


def _refused(system, *words, step=None):
    with pytest.raises(InputError) as caught:
        MujocoModel.of(system, step=step)
    said = str(caught.value)
    assert [word for word in words if word not in said] == [], said
    assert said.endswith(".")


@pytest.mark.parametrize(
    ("up", "down", "embedded", "tick", "expected"),
    [
        (0.005, 0.005, 0.002, 0.001, (1e-3, 5, 6, 1)),
        (0.0041, 0.0, 0.0, 0.002, (1e-4, 41, 0, 20)),
        (0.0, 0.003, 0.0, 0.006, (1e-3, 0, 3, 6)),
        (0.0, 0.0, 0.0, 0.001, (1e-3, 0, 0, 1)),
    ],
)
def test_the_step_is_the_longest_that_divides_all(tmp_path, up, down, embedded, tick, expected):
    delays = constant_delays(up, down, embedded, sample_time=tick)
    system = arm_system(tmp_path, delays=delays)
    steps = MujocoModel.of(system).steps
    assert (steps.step, steps.measurement, steps.command, steps.tick) == expected
    assert steps.total == pytest.approx(delays.d_1, abs=1e-12)


def test_stiff_springs_shorten_the_step_to_a_decimal_one(tmp_path):
    delays = constant_delays(0.002, 0.003, sample_time=0.001)
    stiff = {"spring_stiffness": 1e5, "rotor_inertia": 0.1}
    system = arm_system(tmp_path, delays=delays, springs=stiff)
    steps = MujocoModel.of(system).steps
    M = system.robot.mass_matrix(system.posture)
    fastest = np.sqrt(np.linalg.eigvals(np.linalg.inv(M) * 1e5).real.max() + 1e5 / 0.05)
    assert steps.step < 1.0 / fastest
    assert (1e-3 / steps.step) == pytest.approx(round(1e-3 / steps.step))
    assert (steps.measurement * steps.step, steps.command * steps.step) == pytest.approx(
        (0.002, 0.003)
    )
    _refused(system, "1 ms", "too long for the design's springs", "would do", step=1e-3)
    hard = arm_system(tmp_path, delays=delays, springs={"spring_stiffness": 1e12})
    _refused(hard, "springs allow steps of", "shorter than 0.001 ms", "softer springs")


def test_a_step_that_divides_no_delay_is_refused_with_one_that_does(tmp_path):
    delays = constant_delays(0.0, 0.0025, sample_time=0.001)
    system = arm_system(tmp_path, delays=delays)
    _refused(system, "delay of commands, 2.5 ms", "step 1 ms", "3 ms", "0.5 ms would do", step=1e-3)
    assert MujocoModel.of(system, step=5e-4).steps.command == 5
    assert MujocoModel.of(system, step=1e-4).steps.command == 25
    _refused(system, "at least 0.001 ms", "0.5 ms would do", step=0.0)
    _refused(system, "nan", step=float("nan"))
    _refused(system, "inf", step=float("inf"))


def test_delays_without_a_common_step_are_refused(tmp_path):
    delays = constant_delays(0.001 / 3.0, 0.002, sample_time=0.001)
    _refused(arm_system(tmp_path, delays=delays), "No step of 0.001 ms", "0.333333333 ms", "round")


WAY = Link(delay=Constant(0.002))


@pytest.mark.parametrize(
    ("link", "words"),
    [
        (
            Link(delay=Sinusoid(mean=0.01, amplitude=0.005, angular_frequency=1.0)),
            ("varies between 5 ms and 15 ms", "value_ms = 15"),
        ),
        (
            Link(delay=Table(time=np.array([0.0, 1.0]), delay=np.array([0.004, 0.005]))),
            ("varies between 4 ms and 5 ms", "value_ms = 5"),
        ),
        (replace(WAY, jitter=0.001), ("varies between 2 ms and 3 ms", "value_ms = 3")),
        (replace(WAY, loss=0.1), ("loses packets, 0.1 of all", "value_ms = 2")),
    ],
)
def test_delays_that_vary_are_refused(tmp_path, link, words):
    for place in ("up", "down"):
        central = replace(RoundTrip(up=WAY, down=WAY), **{place: link})
        delays = Delays(central=central, embedded=Constant(0.0), sample_time=0.001)
        system = arm_system(tmp_path, delays=delays)
        _refused(system, f"way {place} of the central connection", *words)
    drives = RoundTrip(up=WAY, down=link)
    delays = Delays(central=Constant(0.0), embedded=drives, sample_time=0.001)
    system = arm_system(tmp_path, delays=delays)
    _refused(system, "way down of the embedded connection", *words)
    unheard = Delays(
        central=Constant(0.0), embedded=RoundTrip(up=link, down=WAY), sample_time=0.001
    )
    assert MujocoModel.of(arm_system(tmp_path, delays=unheard)).steps.command == 2


def test_an_embedded_period_rounds_each_hop_up_as_the_simulator_does(tmp_path):
    central = RoundTrip(up=Link(delay=Constant(0.0012)), down=Link(delay=Constant(0.0007)))
    delays = Delays(
        central=central,
        embedded=RoundTrip(up=WAY, down=Link(delay=Constant(0.0006))),
        sample_time=0.002,
        embedded_period=0.0005,
    )
    steps = MujocoModel.of(arm_system(tmp_path, delays=delays)).steps
    assert (steps.measurement_delay, steps.command_delay) == (0.0015, 0.002)
    clock = Clock(physics=1e-4, embedded=0.0005, central=0.002)
    plan = Network.from_delays(delays).plan(clock, duration=0.1, seed=1)
    ages = plan.ages(0.1)
    assert ages.measurement == pytest.approx(steps.measurement_delay)
    assert ages.command == pytest.approx(steps.command_delay + steps.hold)
    assert ages.total == pytest.approx(steps.total)
    assert steps.total < delays.d_1  # a bound, which counts each wait whole


def test_drives_that_a_rotor_is_not_are_refused(tmp_path):
    slow = arm_system(tmp_path, springs={"torque_bandwidth": np.array([np.inf, 300.0])})
    _refused(slow, "joint1", "torque_bandwidth", "leave the key out")
    late = constant_delays(0.001, 0.001, 0.002, sample_time=0.001, delayed_torque_feedback=True)
    _refused(arm_system(tmp_path, delays=late), "joint0", "delayed_torque_feedback")
    unshaped = arm_system(tmp_path, delays=late, springs={"inertia_shaping": 1.0})
    assert MujocoModel.of(unshaped).steps.command == 2  # no torque is fed back


def test_mimic_joints_are_refused(tmp_path):
    path = tmp_path / "mimic.urdf"
    path.write_text(MIMICS)
    arm = sealag.load_robot(path, floating_base=False)
    system = arm_system(
        tmp_path,
        robot=arm,
        posture=arm.neutral(),
        springs={"spring_stiffness": 300.0, "rotor_inertia": 0.1, "motor_damping": 9.0},
    )
    name = next(iter(arm.followers))
    _refused(system, name, f"mimics {arm.followers[name].leader}", "robot.actuated")


def test_bodies_that_mujoco_refuses_are_named(tmp_path):
    path = tmp_path / "plate.urdf"
    flat = link("plate").replace('izz="0.04"', 'izz="0.051"')  # 0.02 + 0.03 < 0.051: 4 % rounding
    path.write_text(robot(link("base"), flat, joint("turn", "base", "plate")))
    arm = sealag.load_robot(path, floating_base=False)
    system = arm_system(
        tmp_path,
        robot=arm,
        posture=arm.neutral(),
        springs={"spring_stiffness": 300.0, "rotor_inertia": 0.1, "motor_damping": 9.0},
    )
    _refused(system, "joint turn", "principal moments", "0.051", "<inertial>")


def test_rotors_have_shaped_inertia_damping_and_friction(tmp_path):
    springs = {"viscous_friction": 0.8, "coulomb_friction": np.array([2.0, 1.0])}
    system = arm_system(tmp_path, springs=springs)  # inertia_shaping = 0.5
    root = ElementTree.fromstring(MujocoModel.of(system).text)
    found = root.find(".//joint[@name='rotor of joint1']")
    assert found is not None
    values = {key: float(found.get(key, "nan")) for key in ("armature", "damping", "frictionloss")}
    assert values == pytest.approx({"armature": 0.03, "damping": 5.4, "frictionloss": 0.5})


def test_names_are_written_as_xml(tmp_path):
    path = tmp_path / "odd.urdf"
    path.write_text(robot(link("base"), link("a"), joint("&lt;b--&gt;", "base", "a")))
    arm = sealag.load_robot(path, floating_base=False)
    system = arm_system(
        tmp_path,
        robot=arm,
        name="a -- & b",
        posture=arm.neutral(),
        springs={"spring_stiffness": 300.0, "rotor_inertia": 0.1, "motor_damping": 9.0},
    )
    root = ElementTree.fromstring(MujocoModel.of(system).text)
    assert [motor.get("name") for motor in root.iterfind("actuator/motor")] == ["<b-->"]


def test_what_is_left_out_is_said(tmp_path):
    said = " ".join(MujocoModel.of(sealag.load(EXAMPLES / "anymal.toml")).left_out)
    assert all(word in said for word in ("torque limits", "speed limits", "ground and friction"))
    system = arm_system(tmp_path)
    free = Actuators.of(
        system.robot.joints, spring_stiffness=300.0, rotor_inertia=0.1, motor_damping=9.0
    )
    assert MujocoModel.of(replace(system, actuators=free)).left_out == ()
    hume, prompt = sealag.load("bundled:hume"), constant_delays(0.002, 0.002)
    falling = replace(hume, delays=prompt, contacts=())
    assert "no rest: the base floats" in " ".join(MujocoModel.of(falling).left_out)


def test_the_program_mujoco_is_not_needed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert "<mujoco" in MujocoModel.of(arm_system(tmp_path)).text
    project = tomllib.loads((EXAMPLES.parent / "pyproject.toml").read_text())["project"]
    assert not any("mujoco" in one for one in project["dependencies"])
    with pytest.raises(ImportError):  # the control
        import mujoco  # noqa: F401
