"""What a URDF says of links and joints: refused where it cannot be, kept where it can."""

import numpy as np
import pytest

from helpers.mimics import MIMICS, joint, link, robot
from sealag.errors import FileError, RobotError, SealagError, UnknownNameError
from sealag.robot import Contact, load_robot

ARM = (link("base"), link("a"), link("b"), joint("j", "base", "a"), joint("k", "a", "b"))


def fixed(name, parent, child):
    return joint(name, parent, child, kind="fixed")


def inertia(name, *moments, mass: float | str = 1.0):
    ixx, iyy, izz = moments
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 -0.2"/><mass value="{mass}"/><inertia '
        f'ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def read(folder, text, **options):
    path = folder / "r.urdf"
    path.write_text(text)
    return load_robot(path, **{"floating_base": False, **options})


FIXED = fixed("l", "b", "c")

BROKEN = {
    "two parents": ((*ARM, joint("l", "base", "b")), ["link b", "two parents", "k", "l", "remove"]),
    "two parents, fixed": ((*ARM, fixed("l", "base", "b")), ["link b", "two parents", "closed"]),
    "loop": ((*ARM, joint("l", "b", "base")), ["loop", "j", "k", "l", "base"]),
    "loop beside": (
        (*ARM, link("c"), link("d"), joint("l", "c", "d"), joint("m", "d", "c")),
        ["loop", "l", "m", "links c, d"],
    ),
    "itself": ((*ARM, link("c"), fixed("l", "c", "c")), ["loop", "joints l", "links c"]),
    "two roots": ((*ARM, link("c"), link("d"), joint("l", "c", "d")), ["base, c", "no parent"]),
    "lonely link": ((*ARM, link("c")), ["base, c", "fixed joints"]),
    "unknown child": ((*ARM, joint("l", "b", "bb")), ["'bb'", "child of joint l", "did you mean"]),
    "unknown parent": ((*ARM, link("c"), joint("l", "x", "c")), ["'x'", "parent of joint l"]),
    "no child": ((*ARM, '<joint name="l" type="fixed"><parent link="a"/></joint>'), ["l", "child"]),
    "link twice": ((*ARM, link("a")), ["2 links", "called a", "of its own"]),
    "joint twice": ((*ARM, link("c"), joint("k", "b", "c")), ["2 joints", "called k"]),
    "nameless link": ((*ARM, link("")), ["link is called ''"]),
    "reserved": ((*ARM, link("c"), joint("universe", "b", "c")), ["'universe'", "another name"]),
    "plate": ((*ARM, inertia("c", 0.01, 0.01, 0.2), joint("l", "b", "c")), ["c", "0.2", "tri"]),
    "little": ((*ARM, inertia("c", 1, 1, 2.3), joint("l", "b", "c")), ["c", "2.3", "triangle"]),
    "plate, fixed": ((*ARM, inertia("c", 0.01, 0.01, 0.2), FIXED), ["link c", "0.2"]),
    "negative": ((*ARM, inertia("c", 0.1, -0.01, 0.1), FIXED), ["c", "-0.01", "neg"]),
    "light": ((*ARM, inertia("c", 0, 0, 0, mass=-0.5), FIXED), ["link c", "'-0.5'"]),
    "endless": ((*ARM, inertia("c", 1, 1, 1, mass="inf"), FIXED), ["link c", "'inf'"]),
    "odd moment": ((*ARM, inertia("c", 1, "nan", 1), FIXED), ["iyy", "link c"]),
    "no mass": ((*ARM, '<link name="c"><inertial/></link>', FIXED), ["c", "<mass>"]),
    "damping": ((*ARM, link("c"), joint("l", "b", "c", dynamics=(-1, 0))), ["damping", "l", "-1"]),
    "friction": ((*ARM, link("c"), joint("l", "b", "c", dynamics=(0, "inf"))), ["friction", "inf"]),
    "unknown leader": ((*ARM, link("c"), joint("l", "b", "c", mimic=("kk", 1, 0))), ["'kk'", "l"]),
    "circle": (
        (*ARM, link("c"), link("d"), joint("l", "b", "c", mimic=("m", 1, 0)),
         joint("m", "c", "d", mimic=("l", 1, 0))),
        ["l, m", "circle"],
    ),
    "own leader": ((*ARM, link("c"), joint("l", "b", "c", mimic=("l", 1, 0))), ["l", "circle"]),
    "odd ratio": ((*ARM, link("c"), joint("l", "b", "c", mimic=("k", "much", 0))), ["multiplier"]),
    "odd offset": ((*ARM, link("c"), joint("l", "b", "c", mimic=("k", 1, "inf"))), ["offset"]),
    "far follower": (
        (*ARM, link("c"), joint("l", "b", "c", mimic=("k", 1, 7))), ["l follows k", "-3 … 3"]
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_what_cannot_be_is_refused_by_name(name, tmp_path):
    parts, words = BROKEN[name]
    with pytest.raises(SealagError) as caught:
        read(tmp_path, robot(*parts))
    message = str(caught.value)
    assert "r.urdf" in message
    for word in words:
        assert word in message


SOUND = {
    "the arm": ARM,
    "a rounded plate": (*ARM, inertia("c", 0.012, 0.012, 0.025), joint("l", "b", "c")),
    "a cover": (*ARM, inertia("c", 0, 0, 0.003, mass=0.1), FIXED),
    "a point": (*ARM, inertia("c", 0, 0, 0), FIXED),
    "no mass": (*ARM, '<link name="c"/>', FIXED),
}


@pytest.mark.parametrize("name", SOUND)
def test_what_can_be_is_read(name, tmp_path):
    assert read(tmp_path, robot(*SOUND[name])).joints[:2] == ("j", "k")


@pytest.mark.parametrize(
    "path",
    ["anymal_c_simple_description/urdf/anymal.urdf", "pr2_description/urdf/pr2.urdf",
     "allegro_hand_description/urdf/allegro_left_hand.urdf", "tiago_description/robots/tiago.urdf",
     "bolt_description/robots/bolt.urdf", "icub_description/robots/icub_reduced.urdf"],
)  # fmt: skip
def test_placeholders_of_public_robots_are_no_reason(path):
    assert load_robot(f"example-robot-data:{path}", floating_base=True).n > 0


def test_a_link_goes_before_a_joint_of_its_name(tmp_path):
    """Joint b moves link c and joint c moves link b: each name means the link."""
    crossed = (*ARM[:2], link("b"), link("c"), joint("c", "a", "b"), joint("b", "b", "c"),
               joint("j", "base", "a"))  # fmt: skip
    plain = (*ARM[:2], link("b"), link("c"), joint("k", "a", "b"), joint("l", "b", "c"),
             joint("j", "base", "a"))  # fmt: skip
    ours, theirs = (read(tmp_path, robot(*parts)) for parts in (crossed, plain))
    assert ours.frame_names().count("b") == 1
    q = np.array([0.3, -0.4, 0.5])
    for name in ("b", "c"):
        assert ours.check_frame(name) == name
        np.testing.assert_array_equal(ours.frame_jacobian(name, q), theirs.frame_jacobian(name, q))
        held = [Contact(frame=name)]
        np.testing.assert_array_equal(
            ours.contact_bias(held, q, q), theirs.contact_bias(held, q, q)
        )
    wrong = theirs.frame_jacobian("k", q) - ours.frame_jacobian("c", q)
    assert np.abs(wrong).max() > 0.1  # negative control: the joint c is elsewhere
    locked = read(tmp_path, robot(*crossed), actuated=["j", "b"])
    np.testing.assert_allclose(
        locked.frame_placement("c", np.array([0.3, 0.5]))[1],
        ours.frame_placement("c", np.array([0.3, 0.0, 0.5]))[1], atol=1e-15,
    )  # fmt: skip


def test_carriers_move_a_frame_themselves_or_through_followers(tmp_path):
    robot_ = read(tmp_path, MIMICS)
    assert robot_.joints == ("lead", "own")
    np.testing.assert_array_equal(robot_.carriers(["slider"]), [True, False])
    np.testing.assert_array_equal(robot_.carriers(["right"]), [True, True])
    np.testing.assert_array_equal(robot_.carriers(["base"]), [False, False])


def test_followers_are_told_with_the_joint_that_leads(tmp_path):
    followers = read(tmp_path, MIMICS).followers
    slide, chain = followers["slide"], followers["chain"]
    assert (slide.leader, slide.multiplier, slide.offset) == ("lead", -0.5, 0.1)
    assert (chain.leader, chain.multiplier, chain.offset) == ("lead", -1.5, 0.5)
    assert followers["chain"].position(2.0) == pytest.approx(-2.5)
    with pytest.raises(UnknownNameError, match="chain of r follows lead"):
        read(tmp_path, MIMICS).configuration({"chain": 0.1})


def test_damping_and_friction_count_in_the_leaders_coordinates(tmp_path):
    """Power of the whole: Σ d_k (r_k v)² and Σ f_k |r_k v|."""
    coupled = read(tmp_path, MIMICS)
    np.testing.assert_allclose(coupled.damping, [2.0 + 1.5**2 * 1.0, 4.0 + 2.0**2 * 0.5])
    np.testing.assert_allclose(coupled.friction, [0.5 + 1.5 * 0.2, 0.0 + 2.0 * 0.3])
    bare = read(tmp_path, robot(*ARM))
    assert not bare.damping.any()
    assert not bare.friction.any()
    chain = read(tmp_path, MIMICS, actuated=["own"])
    np.testing.assert_allclose(chain.damping, [6.0])


def test_followers_limits_bind_the_leader(tmp_path):
    tail = (link("c"), joint("l", "b", "c", lower=-1, upper=2, mimic=("k", -2.0, 0.5)))
    limited = read(tmp_path, robot(*ARM, *tail))
    np.testing.assert_allclose(limited.position_lower, [-3.0, -0.75])
    np.testing.assert_allclose(limited.position_upper, [3.0, 0.75])


def test_effort_and_velocity_limits_are_what_the_file_says(tmp_path):
    text = robot(*ARM).replace('effort="9" velocity="8"', 'effort="0" velocity="0"', 1)
    limited = read(tmp_path, text)
    np.testing.assert_array_equal(limited.effort_limit, [0.0, 9.0])
    np.testing.assert_array_equal(limited.velocity_limit, [0.0, 8.0])
    free = robot(*ARM).replace(
        'type="revolute"', 'type="continuous"', 1
    ).replace('<limit lower="-3.0" upper="3.0" effort="9" velocity="8"/>', "", 1)  # fmt: skip
    np.testing.assert_array_equal(read(tmp_path, free).effort_limit, [np.inf, 9.0])


def test_a_follower_of_what_is_not_actuated_stays_where_its_leader_puts_it(tmp_path):
    coupled, locked = read(tmp_path, MIMICS), read(tmp_path, MIMICS, actuated=["own"])
    assert set(locked.followers) == {"beside"}
    for name in coupled.link_names():
        place = coupled.frame_placement(name, np.array([0.0, 0.7]))[1]
        np.testing.assert_allclose(locked.frame_placement(name, np.array([0.7]))[1], place)
    with pytest.raises(RobotError, match=r"chain mimics lead.*follows.*locked at 0.5 if lead"):
        read(tmp_path, MIMICS, actuated=["lead", "chain"])


def test_a_follower_with_multiplier_0_stands_still(tmp_path):
    still = (*ARM, link("c"), joint("l", "b", "c", mimic=("k", 0, 0.4)))
    held = read(tmp_path, robot(*still))
    assert held.followers == {}
    free = read(tmp_path, robot(*ARM, link("c"), joint("l", "b", "c")))
    np.testing.assert_allclose(
        held.frame_placement("c", np.array([0.1, 0.2]))[0],
        free.frame_placement("c", np.array([0.1, 0.2, 0.4]))[0],
        atol=1e-15,
    )


def test_continuous_joints_turn_without_end(tmp_path):
    """As one number, not as cosine and sine; a revolute one keeps its limits."""
    text = robot(link("base"), link("a"), joint("j", "base", "a", kind="continuous"))
    arm = read(tmp_path, text)
    assert (arm.nq, arm.nv) == (1, 1)
    assert arm.position_upper[0] >= 1e6
    assert arm.position_lower[0] <= -1e6
    limited = read(tmp_path, text.replace('type="continuous"', 'type="revolute"'))
    assert limited.position_upper[0] < 100.0


@pytest.mark.parametrize("mass", [1.0, 1e-12])
def test_links_that_weigh_nothing_are_named(mass, tmp_path):
    size = 1e-12 if mass < 1.0 else 0.1
    text = robot(link("base"), inertia("a", size, size, size, mass=mass), joint("j", "base", "a"))
    if mass == 1.0:
        read(tmp_path, text)
        return
    with pytest.raises(RobotError, match=r"almost no inertia to what moves at a \(joint j\)"):
        read(tmp_path, text)


def test_an_example_robot_that_is_not_there_is_no_missing_package():
    with pytest.raises(FileError, match=r"example-robot-data has no file no/such\.urdf"):
        load_robot("example-robot-data:no/such.urdf", floating_base=False)
