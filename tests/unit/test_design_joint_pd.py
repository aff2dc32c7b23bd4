"""controller.kind = "joint_pd": the file's gains are the law's, and three numbers come out."""

import tomllib

import numpy as np
import pytest

import sealag
from helpers.controllers import JointPD
from helpers.designs import EXAMPLES
from helpers.toml import to_toml
from sealag.errors import ProjectError

GO2 = EXAMPLES / "go2.toml"


def go2(tmp_path, **keys):
    """The example with other keys of its controller; None takes one away."""
    data = tomllib.loads(GO2.read_text())
    data |= {name: keys.pop(name) for name in ("tasks",) if name in keys}
    data["controller"] |= keys
    data["controller"] = {k: v for k, v in data["controller"].items() if v is not None}
    path = tmp_path / "pd.toml"
    path.write_text(to_toml(data))
    return path


def test_damping_in_the_drives_has_a_passive_bound(tmp_path):
    """K_p d ≤ D: the classical condition of motor-side stiffness."""
    found = sealag.load(go2(tmp_path, kp=40.0, kd=1.0)).local_margins()
    assert found.passive_s == pytest.approx((1.0 + 0.05) / 40.0, rel=1e-6)
    assert found.passive_s <= found.jitter_s * (1.0 + 1e-8) <= found.delay_s * (1.0 + 1e-8)
    assert found.not_passive == ""


@pytest.mark.parametrize(("kp", "kd"), [(20.0, 0.5), (80.0, 5.0)])
def test_damping_in_the_controller_has_none(tmp_path, kp, kd):
    found = sealag.load(go2(tmp_path, kp=kp, kd=kd, damping_at="controller")).local_margins()
    assert found.passive_s == 0.0
    assert "rates that come late" in found.not_passive
    assert 0.0 < found.jitter_s < found.delay_s < 2e-3


@pytest.mark.parametrize("feedback", ["motor", "joint"])
def test_it_is_the_loop_of_a_pd_that_ticks(tmp_path, feedback):
    """An arm under a PD that somebody else wrote, frozen by its ticks."""
    text = (EXAMPLES / "panda.toml").read_text().replace('"motor"', f'"{feedback}"')
    path = tmp_path / "panda.toml"
    path.write_text(text)
    system, keys = sealag.load(path), tomllib.loads(text)["controller"]
    kp, kd = (np.array([keys[name][j] for j in system.robot.joints]) for name in ("kp", "kd"))
    rest = system.rest()
    gravity = system.robot.gravity(system.posture)
    held = rest.theta if feedback == "motor" else system.robot.joint_positions(rest.q)
    wanted = held + (rest.tau_sea - gravity) / kp

    class Compensated(JointPD):
        def tick(self, t, measurement, out):
            super().tick(t, measurement, out)
            out += gravity

    pd = Compensated(wanted, stiffness=kp, damping=kd, motor=feedback == "motor")
    other = sealag.freeze(
        pd, system.robot, system.actuators, q=rest.q, theta=rest.theta
    ).loop  # fmt: skip
    loop = system.frozen(rest=rest)
    np.testing.assert_allclose(loop.A_1, other.A_1, atol=1e-7 * np.abs(other.A_1).max())
    assert loop.margin().delay == pytest.approx(other.margin().delay, rel=1e-6)


def test_a_table_needs_every_joint(tmp_path):
    with pytest.raises(ProjectError, match=r"controller.kd has no number for joint FL_thigh_joint"):
        sealag.load(go2(tmp_path, kd={"FL_hip_joint": 1.0}))
    with pytest.raises(ProjectError, match=r"controller.kp.*'hip'"):
        sealag.load(go2(tmp_path, kp={"hip": 1.0}))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"kp": "stiff"}, r"controller.kp is 'stiff'; it must be a number"),
        ({"kp": None}, r"controller.kp is missing"),
        ({"kp": -1.0}, r"controller.kp is -1.0"),
        ({"kind": "pid"}, r"controller.kind is 'pid'; it must be one of 'wbosc', 'joint_pd'"),
        ({"damping_at": "hub"}, r"damping_at is 'hub'; it must be 'controller' or 'drive'"),
        ({"stiffness_form": "force"}, r"controller.stiffness_form is not known"),
        ({"feedback": "static_joint"}, r"it must be 'motor' or 'joint'"),
        ({"tasks": [{"name": "x", "kind": "posture", "stiffness": 1.0}]}, "tasks.* are given"),
        ({"kind": "wbosc", "kp": None, "kd": None, "damping_at": None, "feedback": "motor"},
         r"the key tasks is missing"),
    ],
)  # fmt: skip
def test_wrong_keys_are_named(tmp_path, keys, words):
    with pytest.raises(ProjectError, match=words):
        sealag.load(go2(tmp_path, **keys))


def test_a_push_dies_down_or_shakes_the_legs(tmp_path):
    """7 ms around the loop: 26 ms are tolerated in the drives, 1.5 ms in the controller."""
    last = {}
    for place in ("drive", "controller"):
        project = go2(tmp_path, damping_at=place)
        run = sealag.simulate(project, scenario="balance", duration=1.2)
        last[place] = float(np.abs(run.v[-150:, 6:]).max())
    assert last["drive"] < 0.1
    assert last["controller"] > 0.5
