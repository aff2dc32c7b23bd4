"""Every URDF of example-robot-data from its file to a short run: an answer, or a reason.

`make corpus FOLDER=…` takes the robots of any other folder the same way.
"""

import json

import pytest

from corpus.find import robots
from corpus.run import Answer, contradictions, misspoken, taken
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


_STEP = "physics step of 0.01 ms is too long"
STOPPED = {
    "allegro_hand_description/urdf/allegro_left_hand.urdf": _STEP,
    "allegro_hand_description/urdf/allegro_right_hand.urdf": _STEP,
    "tiago_description/robots/tiago_no_hand.urdf": _STEP,
}
"""Robots that `certify` answers, but that are not run: fingers and a wrist that are too light for
the rule's springs. Besides them each one is run."""

LARGE = ("alex_", "b1-z1", "centauro", "g1_", "human", "icub", "pr2", "romeo", "talos_full",
         "talos_reduced", "tiago.", "tiago_dual", "tiago_pro")  # fmt: skip
"""Robots with 19 joints and more take up to minutes each: `make corpus` alone runs these."""


def large(name):
    return any(part in name for part in LARGE)


@pytest.mark.parametrize("name", NAMES)
def test_a_starter_file_is_of_the_robot_or_says_why_not(name, tmp_path):
    found = taken(FOLDER / name, tmp_path, read_only=True)
    assert found.findings == ()
    assert (found.refusal != "") == (word(name) is not None), found.refusal
    assert (word(name) or "") in found.refusal
    assert (found.joints > 0) == (found.refusal == "")


@pytest.mark.slow
@pytest.mark.parametrize("name", [one for one in NAMES if not word(one) and not large(one)])
def test_all_answers_about_a_robot_agree(name, tmp_path):
    found = taken(FOLDER / name, tmp_path)
    print(f"{name}: {found.joints} joints, {found.verdict}, {found.seconds:.1f} s")
    assert found.findings == ()
    assert (found.refusal != "") == (name in STOPPED), found.refusal
    assert STOPPED.get(name, "") in found.refusal


def test_there_are_robots():
    assert len(NAMES) > 60
    assert set(REFUSED) <= set(NAMES)


CERTIFICATE = {
    "status": "certified", "delay_s": 0.003, "max_delay_s": 0.008, "stable": True,
    "local_margin_s": 0.009, "unstable_modes": 0,
}  # fmt: skip
MARGIN = {"passive_s": 0.008, "delay_s": 0.009, "unstable_modes": 0, "equilibrium": "found"}
RUN = {"outcome": "completed", "message": "", "energy_residual_j": 0.0, "energy_throughput_j": 1.0}
VERIFIED = {"valid": True, "status": "certified"}


def disagreements(*, certify=0, simulate=0, **changed):
    """What is found where some keys of the four answers are others."""
    answers = [
        Answer(status=status, out=json.dumps(said | changed.get(name, {})), err="")
        for name, status, said in (
            ("certificate", certify, CERTIFICATE), ("verified", 0, VERIFIED),
            ("margin", 0, MARGIN), ("run", simulate, RUN),
        )
    ]  # fmt: skip
    return list(contradictions(*answers))


CONTRADICTIONS = {
    "status": {"certify": 1},
    "invalid": {"verified": {"valid": False}},
    "other status": {"verified": {"status": "passive_only"}},
    "too late": {"certificate": {"delay_s": 0.02}},
    "not stable": {"certificate": {"stable": False}},
    "other bound": {"margin": {"passive_s": 0.0079}},
    "other margin": {"margin": {"delay_s": 0.0085}},
    "above the margin": {"certificate": {"local_margin_s": 0.007}, "margin": {"delay_s": 0.007}},
    "other roots": {"margin": {"unstable_modes": 2}},
    "fell": {"simulate": 1, "run": {"outcome": "fell"}},
    "fell with status 0": {"run": {"outcome": "fell"}},
    "energy": {"run": {"energy_residual_j": 1e-3}},
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_a_contradiction_is_found(name):
    """The control: four answers that agree, and one of them changed."""
    assert disagreements() == []
    assert disagreements(**CONTRADICTIONS[name]) != []


@pytest.mark.parametrize(
    ("sentence", "good"),
    [("sealag: it is wrong.", True), ("it is wrong", False), ("sealag: a\nb", False),
     ("sealag: Traceback (most recent call last)", False)],
)  # fmt: skip
def test_a_refusal_is_one_sentence(sentence, good):
    assert (list(misspoken(sentence)) == []) is good


def test_a_traceback_is_found(tmp_path, monkeypatch):
    """The control: a command that breaks."""

    def broken(_arguments):
        raise ZeroDivisionError("x")

    monkeypatch.setattr("corpus.run.main", broken)
    found = taken(FOLDER / "ur_description/urdf/ur5_robot.urdf", tmp_path)
    assert "ZeroDivisionError" in found.findings[0]
