"""A design that does not stand as it says is told so, in numbers, before its certificate."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from sealag.robot import Contact, ContactKind

FEET = [f"{leg}_FOOT" for leg in ("LF", "LH", "RF", "RH")]


@pytest.fixture(scope="module")
def anymal():
    """The example, which stands on four feet."""
    return sealag.load(EXAMPLES / "anymal.toml")


def bent(system, leg, by):
    """The design with a leg's knee bent by an angle, rad."""
    q = system.posture.copy()
    q[7 + system.robot.joint_index(f"{leg}_KFE")] += by
    return replace(system, posture=q)


def test_examples_stand():
    for name in ("anymal", "talos", "baxter", "hume_held", "go2", "panda"):
        assert sealag.load(EXAMPLES / f"{name}.toml").warnings() == ()


def test_a_floating_base_without_contacts_flies(anymal):
    (said,) = replace(anymal, contacts=()).warnings()
    assert "flies" in said
    assert "[[contacts]]" in said
    assert 'base = "fixed"' in said
    assert replace(anymal, contacts=()).warnings(replace(anymal, contacts=()).still()) == (said,)


@pytest.mark.parametrize("leg", ["LF", "RF", "LH", "RH"])
def test_a_lifted_foot_is_named_with_its_height(leg, anymal):
    """Its height is Pinocchio's frame, not the code that warns."""
    lifted = bent(anymal, leg, -0.4 if leg.endswith("F") else 0.4)
    heights = dict(zip(FEET, lifted.robot.link_heights(FEET, lifted.posture), strict=True))
    (said,) = [text for text in lifted.warnings() if "contact" in text.split()[0]]
    over = heights[f"{leg}_FOOT"] - np.median(list(heights.values()))
    assert over > 0.01
    assert said.startswith(f"contact {leg}_FOOT is {over:.3f} m above the other feet")


def test_a_foot_below_the_others_is_named(anymal):
    lowered = bent(anymal, "RH", -0.3)
    heights = lowered.robot.link_heights(FEET, lowered.posture)
    depth = np.median(heights) - heights[3]
    assert depth > 0.01
    said = lowered.warnings()
    assert any(text.startswith(f"contact RH_FOOT is {depth:.3f} m below") for text in said)


def test_one_centimetre_parts_lifted_feet_from_feet_that_stand(anymal):
    """A foot may be raised a little, as soles and postures of few digits are."""
    assert bent(anymal, "LF", -0.01).warnings() == ()


def test_a_centre_of_mass_outside_the_feet_is_measured(anymal):
    """Held by its two front feet: the distance to the line between them, by hand."""
    front = tuple(Contact(frame=name) for name in ("LF_FOOT", "RF_FOOT"))
    (said,) = replace(anymal, contacts=front).warnings()
    robot, q = anymal.robot, anymal.posture
    left, right = (robot.frame_placement(c.frame, q)[1][:2] for c in front)
    com = robot.center_of_mass(q)[:2]
    way, off = right - left, com - left
    along = abs(way[0] * off[1] - way[1] * off[0]) / np.linalg.norm(way)
    found = re.search(r"is ([\d.]+) m outside", said)
    assert found is not None
    assert float(found[1]) == pytest.approx(along, abs=1e-3)


def test_soles_reach_as_far_as_simulation_says(anymal):
    """One sole below TALOS: long enough it carries, short it does not."""
    talos = sealag.load(EXAMPLES / "talos.toml")
    left = (Contact(frame="left_sole_link", kind=ContactKind.SURFACE),)
    robot, q = talos.robot, talos.posture
    rotation, position = robot.frame_placement("left_sole_link", q)
    aside = abs((rotation.T @ (robot.center_of_mass(q) - position))[1])
    assert aside > 0.05
    for half, warns in ((aside + 0.001, False), (aside - 0.02, True)):
        setting = talos.simulation.model_copy(update={"foot_half_width": half})
        design = replace(talos, contacts=left, simulation=setting)
        assert bool(design.warnings()) is warns


def test_along_a_motion_heights_of_feet_are_not_told(anymal):
    lifted = bent(anymal, "LF", -0.4)
    assert lifted.warnings() != ()
    still = lifted.still()
    twice = replace(
        still,
        time=np.array([0.0, 1.0]),
        q=np.repeat(still.q, 2, axis=0),
        v=np.repeat(still.v, 2, axis=0),
        contact_index=np.zeros(2, dtype=np.int64),
    )
    assert lifted.warnings(twice) == ()


def test_a_fixed_base_needs_no_feet():
    assert sealag.load(EXAMPLES / "baxter.toml").warnings() == ()


def test_the_command_line_says_it_first_and_in_json(tmp_path, cli):
    text = (EXAMPLES / "panda.toml").read_text()
    assert 'base = "fixed"' in text
    project = tmp_path / "panda.toml"
    project.write_text(text.replace('base = "fixed"', 'base = "floating"'))
    _, out, _ = cli("certify", project, "--out", tmp_path / "c.json")
    assert out.splitlines()[1].startswith("warning: panda flies")
    _, out, _ = cli("certify", project, "--out", tmp_path / "c.json", "--json")
    (said,) = json.loads(out)["warnings"]
    assert said.startswith("panda flies")
    _, out, _ = cli("certify", EXAMPLES / "panda.toml", "--out", tmp_path / "d.json", "--json")
    assert json.loads(out)["warnings"] == []


def test_a_posture_is_told_the_same_as_a_motion_of_one_instant(anymal):
    lifted = bent(anymal, "LF", -0.4)
    assert lifted.warnings() != ()
    assert lifted.warnings(lifted.still()) == lifted.warnings()
    assert anymal.warnings(lifted.still()) == lifted.warnings()


def walked(system, *, lifted):
    """A motion in which the base moves 0.2 m ahead over feet that hold; without its feet for a
    while if they are lifted."""
    count = 41
    q = np.tile(system.posture, (count, 1))
    q[:, 0] += np.linspace(0.0, 0.2, count)
    index = np.zeros(count, dtype=np.int64)
    if lifted:
        index[1:-1] = 1
    return sealag.Motion(
        time=np.linspace(0.0, 4.0, count),
        q=q,
        v=np.zeros((count, system.robot.nv)),
        contact_sets=(system.contacts, ()),
        contact_index=index,
    )


def test_feet_that_move_while_they_hold_are_named(anymal):
    said = anymal.warnings(walked(anymal, lifted=False))
    assert len(said) == 4
    for frame, text in zip([contact.frame for contact in anymal.contacts], said, strict=True):
        assert text.startswith(f"contact {frame} holds at 4.000 s, but is 0.200 m from")
        assert f"contact:{frame}" in text


def test_feet_that_are_lifted_in_between_may_land_elsewhere(anymal):
    assert anymal.warnings(walked(anymal, lifted=True)) == ()


def test_the_crawl_stands_where_it_holds():
    crawl = sealag.load(EXAMPLES / "anymal_crawl.toml")
    assert crawl.warnings(crawl.motion_of()) == ()
