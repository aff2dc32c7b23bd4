"""Files that other tools write for themselves: what is not of the dynamics is passed over."""

import hashlib
import tomllib

import numpy as np
import pytest

import sealag
from helpers.mimics import joint, link, robot
from sealag.design import starter_project
from sealag.errors import FileError, RobotError, UnknownNameError
from sealag.robot import load_robot

ARM = (link("base"), link("a"), link("b"), joint("j", "base", "a"), joint("k", "a", "b"))
PLAIN = robot(*ARM)
HEAD = PLAIN[: PLAIN.index(">") + 1]


def read(folder, text, **options):
    path = folder / "r.urdf"
    path.write_text(text)
    return load_robot(path, **{"floating_base": False, **options})


def same_dynamics(one, other):
    q = np.linspace(0.3, -0.4, one.nq)
    np.testing.assert_array_equal(one.mass_matrix(q), other.mass_matrix(q))
    np.testing.assert_array_equal(one.gravity(q), other.gravity(q))


FOREIGN = {
    "undeclared prefix": '<drake:acceleration value="1"/>',
    "prefixed attribute": '<gazebo drake:x="1" reference="a"><mu1>0.2</mu1></gazebo>',
    "nameless material": '<material><color rgba="no"/></material>',
    "transmission": '<transmission name="t"><joint name="nowhere"/></transmission>',
}


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_elements_change_nothing(name, tmp_path):
    plain = read(tmp_path, PLAIN)
    same_dynamics(read(tmp_path, PLAIN.replace(HEAD, HEAD + FOREIGN[name])), plain)
    inside = PLAIN.replace("<limit", FOREIGN[name] + "<limit")
    assert inside != PLAIN
    same_dynamics(read(tmp_path, inside), plain)


def test_foreign_attributes_and_a_default_namespace_change_nothing(tmp_path):
    plain = read(tmp_path, PLAIN)
    odd = PLAIN.replace("<robot", '<robot xmlns="urn:x"').replace("<limit", '<limit drake:a="1"')
    same_dynamics(read(tmp_path, odd), plain)


def test_visuals_may_be_of_any_form(tmp_path):
    visual = '<visual><geometry><mesh filename="package://no/x.dae" scale="inch"/></geometry>'
    odd = PLAIN.replace("<inertial>", f'{visual}<origin xyz="a"/></visual><inertial>')
    assert odd != PLAIN
    same_dynamics(read(tmp_path, odd), read(tmp_path, PLAIN))


def test_blank_lines_may_come_before_the_declaration(tmp_path):
    same_dynamics(read(tmp_path, '\n <?xml version="1.0"?>' + PLAIN), read(tmp_path, PLAIN))


def test_without_a_usable_joint_each_reason_is_told(tmp_path):
    free = '<joint name="j" type="planar"><parent link="base"/><child link="a"/></joint>'
    fixed = joint("f", "base", "b", kind="fixed")
    text = robot(link("base"), link("a"), link("b"), free, fixed)
    with pytest.raises(RobotError, match=r"no joint can be actuated: j has more than one"):
        read(tmp_path, text, floating_base=True, skip_unusable=True)


def test_the_hash_is_of_the_file_as_it_is(tmp_path):
    text = PLAIN.replace(HEAD, HEAD + FOREIGN["undeclared prefix"])
    found = read(tmp_path, text)
    assert found.urdf_sha256 == hashlib.sha256(text.encode()).hexdigest()


def test_swapped_limits_are_exchanged_and_told(tmp_path):
    assert read(tmp_path, PLAIN).remarks == ()
    swapped = PLAIN.replace('lower="-3.0" upper="3.0"', 'lower="2" upper="-1"', 1)
    assert swapped != PLAIN
    found = read(tmp_path, swapped)
    assert (found.position_lower[0], found.position_upper[0]) == (-1.0, 2.0)
    (remark,) = found.remarks
    for word in ("joint j", "2 … -1", "-1 … 2"):
        assert word in remark
    assert f"# {remark}" in starter_project(tmp_path / "r.urdf")


def test_a_certificate_says_what_was_read_otherwise(tmp_path):
    swapped = PLAIN.replace('lower="-3.0" upper="3.0"', 'lower="2" upper="-1"', 1)
    keys = []
    for text in (PLAIN, swapped):
        arm = read(tmp_path, text)
        drives = sealag.Actuators.of_robot(
            arm, spring_stiffness=300.0, rotor_inertia=0.1, inertia_shaping=0.5, motor_damping=20.0
        )
        law = sealag.Law(tasks=(sealag.Task(name="rest", kind="posture", stiffness=50.0),))
        delays = sealag.Delays(central=sealag.Constant(0.002), embedded=sealag.Constant(0.001))
        system = sealag.System(
            robot=arm, actuators=drives, law=law, delays=delays, posture=arm.neutral()
        )
        assumptions = sealag.certify(system).answer.assumptions
        keys.append({one.key: one.text for one in assumptions})
    assert "urdf_reading" not in keys[0]
    assert "limits of joint j" in keys[1]["urdf_reading"]


FREE = robot(
    '<link name="world"/>',
    *ARM,
    '<joint name="free" type="floating"><parent link="world"/><child link="base"/></joint>',
)


def test_the_file_s_own_floating_root_joint_is_the_base(tmp_path):
    own = read(tmp_path, FREE, floating_base=True)
    plain = read(tmp_path, PLAIN, floating_base=True)
    assert own.joints == plain.joints
    assert own.nq == plain.nq
    same_dynamics(own, plain)
    np.testing.assert_array_equal(
        own.frame_jacobian("b", own.neutral()), plain.frame_jacobian("b", plain.neutral())
    )
    same_dynamics(read(tmp_path, FREE, floating_base=False), read(tmp_path, PLAIN))


def test_a_floating_joint_elsewhere_is_no_base(tmp_path):
    text = robot(*ARM, link("c"), FREE[FREE.index("<joint name=\"free") :].replace(
        "</robot>", "").replace("world", "b").replace('"base"', '"c"'))  # fmt: skip
    with pytest.raises(RobotError, match="free has more than one degree"):
        read(tmp_path, text, floating_base=True)
    found = read(tmp_path, text, floating_base=True, skip_unusable=True)
    assert found.joints == ("j", "k")
    assert "more than one degree" in found.skipped["free"]


UNUSABLE = robot(
    *ARM, '<link name="c"/>', '<link name="d"/>', joint("l", "b", "c"), joint("m", "c", "d"),
    link("e"), joint("n", "b", "e", mimic=("nowhere", 1, 0)),
)  # fmt: skip


def test_joints_that_cannot_be_actuated_are_commented_out(tmp_path):
    with pytest.raises(UnknownNameError, match="nowhere"):
        read(tmp_path, UNUSABLE)
    with pytest.raises(RobotError, match="joint l"):
        read(tmp_path, UNUSABLE, actuated=["j", "k", "l"])
    found = read(tmp_path, UNUSABLE, skip_unusable=True)
    assert found.joints == ("j", "k")
    assert set(found.skipped) == {"l", "m", "n"}
    text = starter_project(tmp_path / "r.urdf")
    assert tomllib.loads(text)["robot"]["actuated"] == ["j", "k"]
    reasons = [line for line in text.splitlines() if line.startswith('  # "')]
    assert len(reasons) == 3
    assert any("no inertia (link d)" in line for line in reasons)
    assert any("'nowhere'" in line for line in reasons)
    np.testing.assert_array_equal(
        found.mass_matrix(found.neutral()),
        read(tmp_path, UNUSABLE, actuated=["j", "k"]).mass_matrix(found.neutral()),
    )


@pytest.mark.parametrize("beside", [True, False])
def test_a_package_is_found_beside_the_file_or_in_the_environment(beside, tmp_path, monkeypatch):
    folder = tmp_path / "src" / "repository" / "arm_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "urdf" / "arm.urdf").write_text(PLAIN)
    name = "package://arm_description/urdf/arm.urdf"
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    with pytest.raises(FileError, match=r"'arm_description'.*ROS_PACKAGE_PATH"):
        load_robot(name, floating_base=False, relative_to=tmp_path)
    around = folder.parent / "projects" if beside else tmp_path
    if not beside:
        monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / 'src'}")
    assert load_robot(name, floating_base=False, relative_to=around).joints == ("j", "k")
    with pytest.raises(FileError, match="'\\.\\.'"):
        load_robot("package://../arm_description", floating_base=False)


def test_sdf_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(RobotError, match=r"SDF.*convert it to a URDF"):
        read(tmp_path, '<sdf version="1.6"><model name="m"/></sdf>')
