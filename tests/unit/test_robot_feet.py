"""Base, feet and standing posture are those that a person would choose.

The lists are written by hand from what the robots are: which of them stand on legs, and which links
their descriptions call feet or soles, or, where they call none so, end a leg.
"""

import math
import os

import numpy as np
import pytest

from sealag.robot import ContactKind, load_robot

FOUR = {name: tuple(prefix + name for prefix in order) for name, order in {
    "_FOOT": ("LF", "RF", "LH", "RH"),
    "_foot": ("FL", "FR", "RL", "RR"),
}.items()}  # fmt: skip
SOLO = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
TALOS = ("left_sole_link", "right_sole_link")
G1 = ("left_ankle_roll_link", "right_ankle_roll_link")
LEGGED = {
    "a1_description/urdf/a1.urdf": FOUR["_foot"],
    "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf": ("LEFT_FOOT", "RIGHT_FOOT"),
    "anymal_b_simple_description/robots/anymal.urdf": FOUR["_FOOT"],
    "anymal_b_simple_description/robots/anymal-kinova.urdf": FOUR["_FOOT"],
    "anymal_c_simple_description/urdf/anymal.urdf": FOUR["_FOOT"],
    "b1_description/urdf/b1.urdf": FOUR["_foot"],
    "b1_description/urdf/b1-z1.urdf": FOUR["_foot"],
    "bolt_description/robots/bolt.urdf": ("FL_FOOT", "FR_FOOT"),
    "centauro_description/urdf/centauro.urdf": ("wheel_1", "wheel_2", "wheel_3", "wheel_4"),
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": G1,
    "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf": G1,
    "go1_description/urdf/go1.urdf": FOUR["_foot"],
    "go2_description/urdf/go2.urdf": FOUR["_foot"],
    "human_description/robots/human.urdf": ("left_foot", "right_foot"),
    "hyq_description/robots/hyq_no_sensors.urdf": ("lf_foot", "rf_foot", "lh_foot", "rh_foot"),
    "icub_description/robots/icub_reduced.urdf": ("l_sole", "r_sole"),
    "laikago_description/urdf/laikago.urdf": FOUR["_foot"],
    "quadruped_description/urdf/quadruped.urdf":
        ("FL_contact", "FR_contact", "BL_contact", "BR_contact"),
    "simple_humanoid_description/urdf/simple_humanoid.urdf": ("l_ankle", "r_ankle"),
    "solo_description/robots/solo.urdf": SOLO,
    "solo_description/robots/solo12.urdf": SOLO,
    "talos_data/robots/talos_reduced.urdf": TALOS,
    "talos_data/robots/talos_full_v2_box.urdf": TALOS,
}  # fmt: skip
SOLES = {"alexander", "g1", "human", "icub", "simple", "talos"}
"""Those with flat feet, by the first word of their folder."""
HELD = (
    "alex_description/urdf/alex_nub_hands.urdf",
    "alex_description/urdf/alex_sake_hands.urdf",
    "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "asr_twodof_description/urdf/TwoDofs.urdf",
    "baxter_description/urdf/baxter.urdf",
    "double_pendulum_description/urdf/double_pendulum.urdf",
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
    "finger_edu_description/robots/finger_edu.urdf",
    "kinova_description/robots/kinova.urdf",
    "panda_description/urdf/panda.urdf",
    "pr2_description/urdf/pr2.urdf",
    "so_arm_description/urdf/so100.urdf",
    "so_arm_description/urdf/so101.urdf",
    "talos_data/robots/talos_left_arm.urdf",
    "tiago_description/robots/tiago.urdf",
    "tiago_description/robots/tiago_dual.urdf",
    "tiago_pro_description/robots/tiago_pro.urdf",
    "ur_description/urdf/ur3_robot.urdf",
    "ur_description/urdf/ur5_gripper.urdf",
    "ur_description/urdf/ur10_joint_limited_robot.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "z1_description/urdf/z1.urdf",
)


def example(name):
    return load_robot(f"example-robot-data:{name}", floating_base=False)


def test_the_lists_are_long_enough():
    assert len(LEGGED) >= 20
    assert len(HELD) >= 20
    assert not set(LEGGED) & set(HELD)


@pytest.mark.parametrize("name", LEGGED)
def test_legged_robots_stand_on_their_feet(name):
    feet = example(name).feet()
    assert sorted(feet.frames) == sorted(LEGGED[name])
    assert feet.legs == len(LEGGED[name])
    flat = name.split("_")[0] in SOLES
    expected = ContactKind.SURFACE if flat else ContactKind.POINT
    assert {contact.kind for contact in feet.contacts} == {expected}


@pytest.mark.parametrize("name", HELD)
def test_arms_hands_and_carts_have_no_feet(name):
    feet = example(name).feet()
    assert feet.legs == 0
    assert feet.contacts == ()


def test_soles_have_the_size_of_their_shapes():
    """Of TALOS's box, of a mesh around it, and of the four spheres below a G1's foot."""
    box = example("talos_data/robots/talos_full_v2_box.urdf").feet()
    mesh = example("talos_data/robots/talos_full_v2.urdf").feet()
    assert (box.half_length, box.half_width) == pytest.approx((0.105, 0.065), abs=1e-3)
    assert (mesh.half_length, mesh.half_width) == pytest.approx((0.105, 0.065), abs=5e-3)
    g1 = example("g1_description/urdf/g1_29dof_rev_1_0.urdf").feet()
    assert (g1.half_length, g1.half_width) == pytest.approx((0.085, 0.03), abs=1e-6)


def test_a_human_whose_y_axis_points_up_stands_upright():
    feet = example("human_description/robots/human.urdf").feet()
    assert feet.upright == pytest.approx((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)), abs=1e-6)
    assert feet.half_length is None
    assert "the z axis of left_foot is not up" in feet.reason


def link(name, shape="", mass=1.0):
    """A link; `shape` is the inside of its <collision>."""
    inertia = f'ixx="{mass / 100}" ixy="0" ixz="0" iyy="{mass / 100}" iyz="0" izz="{mass / 100}"'
    collision = f"<collision>{shape}</collision>" if shape else ""
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia {inertia}/></inertial>'
        f"{collision}</link>"
    )


def joint(name, parent, child, xyz, axis="", limits=(-2.0, 2.0)):
    kind = "revolute" if axis else "fixed"
    turn = f'<axis xyz="{axis}"/>' if axis else ""
    limit = f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="50" velocity="9"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/>{turn}{limit if axis else ""}</joint>'
    )


def box(x, y, z, xyz="0 0 0"):
    return f'<origin xyz="{xyz}"/><geometry><box size="{x} {y} {z}"/></geometry>'


def biped(*, words=("hip", "knee", "ankle"), sole="", more="", knee=(0.0, 2.5)):
    """A torso with two legs of six joints, and arms whose elbows hang free."""
    parts = [link("torso", box(0.2, 0.2, 0.4, "0 0 0.3"), 10.0), more]
    for side, y in (("left", 0.1), ("right", -0.1)):
        hip, bend, tip = (f"{side}_{word}" for word in words)
        chain = [
            (f"{hip}_yaw", "0 0 1", f"0 {y} 0"), (f"{hip}_roll", "1 0 0", "0 0 0"),
            (f"{hip}_pitch", "0 1 0", "0 0 0"), (f"{bend}", "0 1 0", "0 0 -0.4"),
            (f"{tip}_pitch", "0 1 0", "0 0 -0.4"), (f"{tip}_roll", "1 0 0", "0 0 0"),
        ]  # fmt: skip
        parent = "torso"
        for name, axis, xyz in chain:
            child = f"{name}_part"
            last = name == chain[-1][0]
            parts.append(link(child, box(0.24, 0.1, 0.02, "0.03 0 -0.06") if last else ""))
            limits = knee if name == bend else (-2.0, 2.0)
            parts.append(joint(name, parent, child, xyz, axis, limits))
            parent = child
        if sole:
            parts += [
                link(f"{side}{sole}"),
                joint(f"{side}_end", parent, f"{side}{sole}", "0 0 -0.07"),
            ]
        arm, y = f"{side}_shoulder", 3.0 * y
        parts += [
            link(f"{arm}_part"), joint(arm, "torso", f"{arm}_part", f"0 {y} 0.5", "0 1 0"),
            link(f"{side}_elbow_part", box(0.1, 0.1, 0.1)),
            joint(f"{side}_elbow", f"{arm}_part", f"{side}_elbow_part", "0 0 -0.3", "0 1 0"),
        ]  # fmt: skip
    return f'<robot name="biped">{"".join(parts)}</robot>'


def read(text, tmp_path, *, floating=False):
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return load_robot(path, floating_base=floating)


def test_elbows_of_a_humanoid_are_no_feet_and_ankles_are(tmp_path):
    feet = read(biped(), tmp_path).feet()
    assert feet.frames == ["left_ankle_roll_part", "right_ankle_roll_part"]
    assert (feet.half_length, feet.half_width) == pytest.approx((0.12, 0.05))


@pytest.mark.parametrize("sole", ["_foot_imu", "_ft_sensor", "_skin", "FootIMULink"])
def test_sensors_and_skins_at_a_foot_are_none(sole, tmp_path):
    feet = read(biped(sole=sole), tmp_path).feet()
    assert feet.frames == ["left_ankle_roll_part", "right_ankle_roll_part"]


@pytest.mark.parametrize("sole", ["_sole", "Sole", "_foot_sole_link", "_toe"])
def test_a_sole_at_the_ankle_is_the_foot(sole, tmp_path):
    assert read(biped(sole=sole), tmp_path).feet().frames == [f"left{sole}", f"right{sole}"]


def test_words_that_only_contain_a_foot_s_name_are_none(tmp_path):
    more = link("TorsoLeftIMULink") + joint("t", "torso", "TorsoLeftIMULink", "0 0 -2")
    more += link("base_footprint") + joint("f", "torso", "base_footprint", "0 0 -0.87")
    feet = read(biped(more=more), tmp_path).feet()
    assert feet.frames == ["left_ankle_roll_part", "right_ankle_roll_part"]


def test_legs_without_names_are_found_by_where_they_end(tmp_path):
    feet = read(biped(words=("a", "b", "c")), tmp_path).feet()
    assert feet.frames == ["left_c_roll_part", "right_c_roll_part"]


def test_limbs_without_names_are_no_legs_where_something_reaches_lower(tmp_path):
    more = link("post", box(0.1, 0.1, 1.0)) + joint("p", "torso", "post", "0 0 -0.9")
    assert read(biped(words=("a", "b", "c"), more=more), tmp_path).feet().legs == 0


def test_arms_that_hang_lowest_are_no_legs(tmp_path):
    assert read(biped(words=("upperarm", "forearm", "wrist")), tmp_path).feet().legs == 0


@pytest.mark.parametrize(("places", "legs"), [
    ([(0.0, 0.3), (0.0, 0.1), (0.0, -0.1), (0.0, -0.3)], 0),
    ([(0.3, 0.2), (0.3, -0.1), (-0.3, 0.2), (-0.3, -0.1)], 0),
    ([(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2)], 4),
])  # fmt: skip
def test_limbs_without_names_in_a_row_or_without_a_mirror_are_fingers(places, legs, tmp_path):
    parts = [link("palm", box(0.6, 0.4, 0.1), 2.0)]
    for number, (x, y) in enumerate(places):
        chain = [("palm", f"{x} {y} 0"), (f"p{number}", "0 0 -0.2")]
        for parent, xyz in chain:
            child = f"{'p' if parent == 'palm' else 'q'}{number}"
            parts += [link(child), joint(f"j{child}", parent, child, xyz, "0 1 0")]
        parts += [link(f"t{number}"), joint(f"e{number}", f"q{number}", f"t{number}", "0 0 -0.2")]
    found = read(f'<robot name="hand">{"".join(parts)}</robot>', tmp_path).feet()
    assert found.legs == legs
    assert found.frames == [f"t{number}" for number in range(legs)]


def test_one_foot_is_no_pair_of_legs(tmp_path):
    text = '<robot name="hopper">' + link("body") + link("foot")
    text += joint("j", "body", "foot", "0 0 -0.5", "0 1 0") + "</robot>"
    feet = read(text, tmp_path).feet()
    assert feet.legs == 0
    assert feet.frames == ["foot"]
    assert "foot is called a foot" in feet.reason


def test_legs_whose_ends_have_no_frame_are_asked_for(tmp_path):
    parts = [link("trunk", box(0.6, 0.2, 0.1), 8.0)]
    for name, x, y in (("fl", 0.3, 0.1), ("fr", 0.3, -0.1), ("hl", -0.3, 0.1), ("hr", -0.3, -0.1)):
        parts += [
            link(f"{name}_thigh"),
            joint(f"{name}_hip", "trunk", f"{name}_thigh", f"{x} {y} 0", "0 1 0"),
            link(f"{name}_shank", box(0.02, 0.02, 0.4, "0 0 -0.2")),
            joint(f"{name}_knee", f"{name}_thigh", f"{name}_shank", "0 0 -0.4", "0 1 0"),
        ]  # fmt: skip
    feet = read(f'<robot name="dog">{"".join(parts)}</robot>', tmp_path).feet()
    assert feet.legs == 4
    assert feet.contacts == ()
    assert "add a link by a fixed joint, or in MJCF a site, at the tip of fl_shank" in feet.reason


def test_toes_that_do_not_hang_down_are_found_by_name(tmp_path):
    """Legs folded along the trunk where the joints are at 0; the posture is computed."""
    parts = [link("trunk", box(0.6, 0.2, 0.1), 8.0)]
    for name, x, y in (("fl", 0.3, 0.1), ("fr", 0.3, -0.1), ("hl", -0.3, 0.1), ("hr", -0.3, -0.1)):
        parts += [
            link(f"{name}_upper", box(0.2, 0.02, 0.02, "-0.1 0 0")),
            joint(f"{name}_hip", "trunk", f"{name}_upper", f"{x} {y} 0", "0 1 0", (-3.0, 3.0)),
            link(f"{name}_lower", box(0.2, 0.02, 0.02, "0.1 0 0")),
            joint(f"{name}_bow", f"{name}_upper", f"{name}_lower", "-0.2 0 0", "0 1 0", (0.1, 3.0)),
            link(f"{name}_toe"), joint(f"{name}_tip", f"{name}_lower", f"{name}_toe", "0.2 0 0"),
        ]  # fmt: skip
    robot = read(f'<robot name="dog">{"".join(parts)}</robot>', tmp_path)
    feet = robot.feet()
    assert feet.frames == ["fl_toe", "fr_toe", "hl_toe", "hr_toe"]
    stance = robot.stance(feet.contacts)
    assert stance is not None
    assert 0.2 < stance.height < 0.4


def test_a_mesh_that_is_absent_broken_or_a_pipe_is_no_shape(tmp_path):
    (tmp_path / "bad.stl").write_bytes(b"solid nothing")
    os.mkfifo(tmp_path / "pipe.stl")
    for name in ("absent.stl", "bad.stl", "pipe.stl", "package://none/a.dae", ""):
        mesh = f'<geometry><mesh filename="{name}"/></geometry>'
        text = biped().replace(box(0.24, 0.1, 0.02, "0.03 0 -0.06"), mesh)
        feet = read(text, tmp_path).feet()
        assert feet.frames == ["left_ankle_roll_part", "right_ankle_roll_part"]
        assert feet.half_length is None


def test_a_mesh_s_extents_are_read(tmp_path):
    """A file of the test's own: a plate of 0.3 m by 0.08 m."""
    corners = np.array([[x, y, -0.06] for x in (-0.1, 0.2) for y in (-0.04, 0.04)])
    faces = [corners[[0, 1, 2]], corners[[1, 2, 3]], np.vstack([corners[:2], [[0.0, 0.0, 0.0]]])]
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corner) for corner in face)
        + "endloop\nendfacet\n"
        for face in faces
    )
    (tmp_path / "sole.stl").write_text(f"solid sole\n{facets}endsolid sole\n")
    mesh = '<geometry><mesh filename="sole.stl"/></geometry>'
    feet = read(biped().replace(box(0.24, 0.1, 0.02, "0.03 0 -0.06"), mesh), tmp_path).feet()
    assert (feet.half_length, feet.half_width) == pytest.approx((0.15, 0.04), abs=1e-6)


STANDING = {
    "bolt_description/robots/bolt.urdf": {"FL_KFE": -1, "FR_KFE": -1},
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": {"left_knee_joint": 1, "right_knee_joint": 1},
    "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf": {"left_knee_joint": 1},
    "human_description/robots/human.urdf": {},
    "laikago_description/urdf/laikago.urdf": {"FL_calf_joint": -1, "RR_calf_joint": -1},
    "quadruped_description/urdf/quadruped.urdf": {},
    "talos_data/robots/talos_full_v2.urdf": {"leg_left_4_joint": 1, "leg_right_4_joint": 1},
    "anymal_b_simple_description/robots/anymal.urdf": {"LF_KFE": -1, "LH_KFE": 1},
    "go2_description/urdf/go2.urdf": {"FL_calf_joint": -1},
    "solo_description/robots/solo12.urdf": {},
}
"""Knees, and which way they bend where limits or the makers' own postures leave one way."""


@pytest.mark.parametrize("name", STANDING)
def test_a_stance_stands(name):
    """Soles level, feet on one height, knees bent, the centre of mass between the feet; with the
    four digits that a starter prints."""
    robot = load_robot(f"example-robot-data:{name}", floating_base=True)
    feet = robot.feet()
    stance = robot.stance(feet.contacts, feet.upright)
    assert stance is not None
    joints = np.array([float(f"{value:.4g}") for value in stance.joints])
    q = robot.configuration(joints, base_quaternion=feet.upright)
    robot.require_within_limits(q)
    placed = [robot.frame_placement(frame, q) for frame in feet.frames]
    heights = np.array([position[2] for _, position in placed])
    assert np.ptp(heights) < 2e-3
    assert -heights.min() == pytest.approx(stance.height, abs=2e-3)
    middle = np.mean([position[:2] for _, position in placed], axis=0)
    assert robot.center_of_mass(q)[:2] == pytest.approx(middle, abs=5e-3)
    straight = robot.configuration(np.zeros(robot.n), base_quaternion=feet.upright)
    for frame, (rotation, _) in zip(feet.frames, placed, strict=True):
        if feet.contacts[0].kind is ContactKind.SURFACE:
            level, _ = robot.frame_placement(frame, straight)
            assert np.abs((rotation @ level.T)[:, 2] - [0.0, 0.0, 1.0]).max() < 2e-3
    for knee, sign in STANDING[name].items():
        assert sign * stance.joints[robot.joint_index(knee)] > 0.3
    again = robot.stance(feet.contacts, feet.upright)
    assert again is not None
    assert (again.joints == stance.joints).all()


def test_a_stance_that_limits_forbid_is_none(tmp_path):
    """Knees that bend by 2 rad at least, and ankles that cannot follow."""
    text = biped(knee=(2.0, 2.5)).replace(
        '<axis xyz="0 1 0"/><limit lower="-2.0" upper="2.0"',
        '<axis xyz="0 1 0"/><limit lower="-0.1" upper="0.1"',
    )
    robot = read(text, tmp_path)
    assert robot.stance(robot.feet().contacts) is None


def test_humanoids_stand_with_knees_in_front(tmp_path):
    robot = read(biped(knee=(-2.5, 2.5)), tmp_path)
    stance = robot.stance(robot.feet().contacts)
    assert stance is not None
    for side in ("left", "right"):
        assert stance.joints[robot.joint_index(f"{side}_hip_pitch")] < -0.2
        assert stance.joints[robot.joint_index(f"{side}_knee")] > 0.4


def test_a_root_without_mass_has_feet_all_the_same(tmp_path):
    """Feet are found in the robot whose base is held, which needs no mass there."""
    torso = link("torso", box(0.2, 0.2, 0.4, "0 0 0.3"), 10.0)
    assert read(biped().replace(torso, '<link name="torso"/>'), tmp_path).feet().legs == 2
