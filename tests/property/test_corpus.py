"""Every URDF of example-robot-data from its file to a short run: an answer, or a reason.

`make corpus FOLDER=…` takes the robots of any other folder the same way.
"""

import pytest

from corpus.find import robots
from corpus.run import taken
from helpers.robots import urdf_path

FOLDER = urdf_path("example-robot-data:ur_description/urdf/ur5_robot.urdf").parents[2]
NAMES = [str(path.relative_to(FOLDER)) for path in robots(FOLDER)]

REFUSED = {
    "hector_description/robots/quadrotor_base.urdf": "has no joints",
    "hector_description/robots/quadrotor_base.urdf.xacro": "at least one <link>",
    "iris_description/robots/iris_simple.urdf": "no joint moves",
    "romeo_description/urdf/romeo_laas_small.urdf": "link body has principal moments of inertia -0",
    "romeo_description/urdf/romeo_small.urdf": "RShoulderYawLink has principal moments",
    "ur_description/urdf/ur3.urdf": "at least one <link>",
}
"""Robots that are none, and what says so; besides them only SDF is refused."""


def word(name):
    """What the refusal of a robot says, if it is to be refused."""
    return "SDF" if name.endswith(".sdf") else REFUSED.get(name)


@pytest.mark.parametrize("name", NAMES)
def test_a_starter_file_is_of_the_robot_or_says_why_not(name, tmp_path):
    found = taken(FOLDER / name, tmp_path, read_only=True)
    assert found.findings == ()
    assert (found.refusal != "") == (word(name) is not None), found.refusal
    assert (word(name) or "") in found.refusal
    assert (found.joints > 0) == (found.refusal == "")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if word(name) is None])
def test_all_answers_about_a_robot_agree(name, tmp_path):
    found = taken(FOLDER / name, tmp_path)
    print(f"{name}: {found.joints} joints, {found.verdict}, {found.seconds:.1f} s")
    assert found.findings == ()
    assert found.refusal == ""


def test_there_are_robots():
    assert len(NAMES) > 60
    assert set(REFUSED) <= set(NAMES)
