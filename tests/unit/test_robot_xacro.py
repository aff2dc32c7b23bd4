"""Xacro files are read as the URDF that the package xacro makes of them."""

import subprocess
import sys

import pytest

from helpers.mimics import joint, link, robot
from sealag.errors import RobotError
from sealag.robot import load_robot

MACROS = """<robot xmlns:xacro="http://ros.org/wiki/xacro">
<xacro:macro name="body" params="name mass"><link name="${name}"><inertial><mass value="${mass}"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link></xacro:macro>
</robot>"""
ARM = """<robot name="arm" xmlns:xacro="http://ros.org/wiki/xacro">
<xacro:arg name="mass" default="3"/>
<xacro:include filename="$(find arm_macros)/body.xacro"/>
<xacro:body name="base" mass="1"/><xacro:body name="a" mass="$(arg mass)"/>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="${-pi / 2}" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture(autouse=True)
def _no_packages(monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


def written(folder, text=ARM, *, name="arm.urdf.xacro"):
    path = folder / "arm_description" / "urdf" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    (folder / "arm_macros").mkdir(exist_ok=True)
    (folder / "arm_macros" / "body.xacro").write_text(MACROS)
    return path


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.urdf"])
def test_macros_arguments_and_packages_are_expanded(name, tmp_path):
    found = load_robot(written(tmp_path, name=name), floating_base=False)
    assert found.joints == ("j",)
    assert found.position_lower[0] == pytest.approx(-1.5707963)
    assert found.mass == 3.0


def test_the_hash_is_of_what_is_read(tmp_path):
    path = written(tmp_path)
    first = load_robot(path, floating_base=False).urdf_sha256
    assert load_robot(path, floating_base=False).urdf_sha256 == first
    macros = tmp_path / "arm_macros" / "body.xacro"
    macros.write_text(macros.read_text().replace("0.1", "0.2"))
    assert load_robot(path, floating_base=False).urdf_sha256 != first


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("arm_macros", "arm_mac", ["'arm_mac'", "ROS_PACKAGE_PATH"]),
        (' default="3"', "", ["'default'", "argument:=value"]),
        ("-pi", "-py", ["py", "expand it yourself"]),
        ("body name", "bdy name", ["xacro:bdy"]),
    ],
)
def test_what_xacro_says_is_one_sentence(old, new, words, tmp_path):
    path = written(tmp_path, ARM.replace(old, new, 1))
    with pytest.raises(RobotError) as caught:
        load_robot(path, floating_base=False)
    said = str(caught.value)
    assert said.startswith(str(path))
    assert said.count("\n") == 0
    for word in words:
        assert word in said


def test_without_the_package_the_remedy_is_named(tmp_path):
    """The control of optional: a process that finds no xacro."""
    program = (
        "import sys; sys.modules['xacro'] = None\n"
        "import importlib.util as u; real = u.find_spec\n"
        "u.find_spec = lambda name, *rest: None if name == 'xacro' else real(name, *rest)\n"
        "from sealag.robot import load_robot\n"
        "load_robot(sys.argv[1], floating_base=False)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(written(tmp_path))], capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert "RobotError" in done.stderr
    assert "sealag[xacro]" in done.stderr


def test_a_file_that_has_been_expanded_needs_no_xacro(tmp_path, monkeypatch):
    plain = robot(link("base"), link("a"), joint("j", "base", "a"))
    declared = plain.replace("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"')
    monkeypatch.setattr(subprocess, "run", None)
    path = tmp_path / "plain.urdf"
    path.write_text(declared)
    assert load_robot(path, floating_base=False).joints == ("j",)
