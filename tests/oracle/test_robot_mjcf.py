"""An MJCF file has the dynamics, limits and friction that MuJoCo itself gives it."""

import mujoco
import numpy as np
import pytest

from sealag.errors import FileError, RobotError
from sealag.robot import load_robot

INERTIA = '<inertial pos="0.1 0 -0.1" mass="1" diaginertia="0.02 0.03 0.01"/>'
HINGE = '<joint name="j" axis="0 1 0" range="-30 60"/>'


def mjcf(body, *, compiler="", default="", more=""):
    return (
        f'<mujoco model="m"><compiler {compiler}/><default>{default}</default>'
        f'<worldbody><body name="a" pos="0 0 1" euler="20 0 0">{body}</body></worldbody>{more}'
        "</mujoco>"
    )


def behind(place):
    """A second body behind a hinge, turned as `place` says."""
    return f'{HINGE}{INERTIA}<body name="b" {place}><joint name="k" axis="0 0 1"/>{INERTIA}</body>'


SEVERAL = (
    '<joint name="j" axis="0 1 0" pos="0 0.1 0"/><joint name="s" type="slide" axis="1 0 1" '
    'range="-1 1"/><joint name="k" axis="1 0 0" pos="0 0 0.3"/>'
)
CLASSES = (
    '<joint damping="1"/><default class="x"><joint axis="1 0 0" armature="0.1"/>'
    '<default class="y"><joint frictionloss="0.3" range="-20 20"/></default></default>'
)
SOUND = {
    "a hinge": mjcf(HINGE + INERTIA),
    "radian": mjcf('<joint name="j" axis="0 1 0" range="-1 2"/>' + INERTIA,
                   compiler='angle="radian"'),
    "full inertia": mjcf(HINGE + '<inertial pos="0 .1 0" mass="2" '
                         'fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>'),
    "turned inertia": mjcf(HINGE + '<inertial pos="0 .1 0" quat="0.9 0.1 0.2 0.3" mass="2" '
                           'diaginertia="0.02 0.03 0.04"/>'),
    "several joints": mjcf(SEVERAL + INERTIA + '<body pos="1 0 0"><joint/>' + INERTIA + "</body>"),
    "quat": mjcf(behind('pos="0 0 .2" quat="2 0.1 0.2 0.3"')),
    "euler": mjcf(behind('euler="30 40 50"')),
    "euler, fixed axes": mjcf(behind('euler="30 40 50"'), compiler='eulerseq="ZXY"'),
    "axisangle": mjcf(behind('axisangle="1 1 0 30"')),
    "xyaxes": mjcf(behind('xyaxes="0 1 0 -1 0 0.5"')),
    "zaxis": mjcf(behind('zaxis="0 1 1"')),
    "zaxis, reversed": mjcf(behind('zaxis="0 0 -1"')),
    "classes": mjcf('<joint class="y" name="j"/>' + INERTIA + '<body childclass="x"><joint/>'
                    + INERTIA + '<body><joint class="y"/>' + INERTIA + "</body></body>",
                    default=CLASSES),
    "unlimited": mjcf('<joint name="j" axis="0 1 0" range="-30 60" limited="false"/>' + INERTIA),
    "a fixed body": mjcf(HINGE + INERTIA + f'<body name="c" pos="0 .1 .2">{INERTIA}</body>'),
    "a frame": mjcf(HINGE + INERTIA + '<frame pos="0 0 1" euler="0 30 0"><frame euler="9 0 0">'
                    f'<body pos="0 .1 .2"><joint axis="1 0 0"/>{INERTIA}</body></frame></frame>'),
    "two worlds": mjcf(HINGE + INERTIA, more='<worldbody><geom size="1"/></worldbody>'),
    "geoms without mass": mjcf(
        f'{HINGE}{INERTIA}<geom size="3"/><body><geom class="v" size="1"/></body>',
        default='<default class="v"><geom mass="0"/></default>'),
}  # fmt: skip


def pair(folder, text):
    """The robot as sealag and as MuJoCo read it, and a configuration."""
    (folder / "m.xml").write_text(text)
    theirs = mujoco.MjModel.from_xml_path(str(folder / "m.xml"))
    ours = load_robot(folder / "m.xml", floating_base=False)
    assert ours.nv == theirs.nv
    return ours, theirs, np.random.default_rng(3).uniform(-0.5, 0.5, theirs.nq)


def mass_and_gravity(theirs, q):
    data = mujoco.MjData(theirs)
    data.qpos[:] = q
    mujoco.mj_forward(theirs, data)
    M = np.zeros((theirs.nv, theirs.nv))
    mujoco.mj_fullM(theirs, data, M)
    return M - np.diag(theirs.dof_armature), data.qfrc_bias.copy()


@pytest.mark.parametrize("name", SOUND)
def test_dynamics_are_mujoco_s(name, tmp_path):
    ours, theirs, q = pair(tmp_path, SOUND[name])
    M, gravity = mass_and_gravity(theirs, q)
    np.testing.assert_allclose(ours.mass_matrix(q), M, atol=1e-12)
    np.testing.assert_allclose(ours.gravity(q), gravity, atol=1e-12)
    np.testing.assert_array_equal(ours.rotor_inertia, theirs.dof_armature)
    np.testing.assert_array_equal(ours.friction, theirs.dof_frictionloss)
    np.testing.assert_array_equal(
        ours.damping, np.reshape(theirs.dof_damping, (theirs.nv, -1))[:, 0]
    )
    limited = theirs.jnt_limited.astype(bool)
    ends = np.where(limited[:, None], theirs.jnt_range, [-np.inf, np.inf])
    np.testing.assert_allclose(np.stack([ours.position_lower, ours.position_upper], 1), ends)


def test_sites_and_bodies_are_frames(tmp_path):
    text = mjcf(SEVERAL + INERTIA + '<site name="tip" pos="0 0.2 0.3" euler="0 9 0"/>')
    ours, theirs, q = pair(tmp_path, text)
    data = mujoco.MjData(theirs)
    data.qpos[:] = q
    mujoco.mj_forward(theirs, data)
    for name, place in (("a", data.body("a").xpos), ("tip", data.site("tip").xpos)):
        np.testing.assert_allclose(ours.frame_placement(name, q)[1], place, atol=1e-12)
    turn = data.site("tip").xmat.reshape(3, 3)
    np.testing.assert_allclose(ours.frame_placement("tip", q)[0], turn, atol=1e-12)


def test_a_free_joint_is_the_base(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(mjcf("<freejoint/>" + INERTIA + f"<body>{HINGE}{INERTIA}</body>"))
    floating = load_robot(path, floating_base=True)
    assert floating.joints == ("j",)
    assert floating.nv == 7
    theirs = mujoco.MjModel.from_xml_path(str(path))
    M, gravity = mass_and_gravity(theirs, [0, 0, 0, 1, 0, 0, 0, 0.4])
    q = floating.configuration([0.4])
    np.testing.assert_allclose(floating.mass_matrix(q), M, atol=1e-12)
    np.testing.assert_allclose(floating.gravity(q), gravity, atol=1e-12)
    assert load_robot(path, floating_base=False).nv == 1


def test_included_files_are_read_and_hashed(tmp_path):
    whole = mjcf(behind('pos="0 0 1"'))
    inner = whole[whole.index("<worldbody>") : whole.index("</mujoco>")]
    (tmp_path / "tree.xml").write_text(f"<mujocoinclude>{inner}</mujocoinclude>")
    ours, theirs, q = pair(tmp_path, whole.replace(inner, '<include file="tree.xml"/>'))
    np.testing.assert_allclose(ours.mass_matrix(q), mass_and_gravity(theirs, q)[0], atol=1e-12)
    first = ours.urdf_sha256
    (tmp_path / "tree.xml").write_text(f"<mujocoinclude>{inner} </mujocoinclude>".replace("1", "2"))
    assert load_robot(tmp_path / "m.xml", floating_base=False).urdf_sha256 != first
    (tmp_path / "tree.xml").unlink()
    with pytest.raises(FileError, match=r"tree\.xml"):
        load_robot(tmp_path / "m.xml", floating_base=False)


REFUSED = {
    "mass of a geom": (mjcf(HINGE + '<geom size="0.1"/>'), ["body a", "<inertial>"]),
    "a ball": (mjcf(HINGE + INERTIA + f'<body><joint name="b" type="ball"/>{INERTIA}</body>'),
               ["joint b", "more than one"]),
    "a spring": (mjcf(f'<joint name="j" stiffness="3"/>{INERTIA}'), ["stiffness of joint j"]),
    "a damper with a spring": (mjcf(f'<joint name="j" springdamper="1 1"/>{INERTIA}'),
                               ["springdamper of joint j"]),
    "a fluid": (mjcf(HINGE + INERTIA, more='<option density="1.2"/>'), ["density", "fluid"]),
    "a shifted zero": (mjcf(f'<joint name="j" ref="3"/>{INERTIA}'), ["ref of joint j"]),
    "gravity": (mjcf(HINGE + INERTIA, more='<option gravity="0 0 -1.62"/>'), ["1.62", "9.81"]),
    "a constraint": (mjcf(behind(""), more='<equality><joint joint1="j"/></equality>'),
                     ["<equality>", "tree"]),
    "a tendon": (mjcf(HINGE + INERTIA, more='<tendon><fixed stiffness="2"><joint joint="j" '
                      'coef="1"/></fixed></tendon>'), ["tendon", "stiffness"]),
    "total mass": (mjcf(HINGE + INERTIA, compiler='settotalmass="3"'), ["settotalmass"]),
    "no such class": (mjcf('<joint class="x"/>' + INERTIA), ["'x'", "class"]),
    "copies": (mjcf(HINGE + INERTIA + '<replicate count="2"><body/></replicate>'), ["<replicate>"]),
    "three numbers": (mjcf(HINGE + INERTIA + '<body pos="1 2"/>'), ["pos", "3 numbers"]),
    "no direction": (mjcf('<joint name="j" axis="0 0 0"/>' + INERTIA), ["axis of joint j"]),
    "no joint": (mjcf(INERTIA), ["no joint moves"]),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_translated_is_refused(name, tmp_path):
    text, words = REFUSED[name]
    (tmp_path / "m.xml").write_text(text)
    with pytest.raises(RobotError) as caught:
        load_robot(tmp_path / "m.xml", floating_base=False)
    for word in (*words, "m.xml"):
        assert word in str(caught.value)
