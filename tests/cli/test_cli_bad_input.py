"""Bad input: one sentence that names file, key and remedy, exit status 2, never a traceback."""

from pathlib import Path

import numpy as np
import pytest

from sealag.cli import main
from sealag.design import load, motion_table, save_motion
from sealag.robot import bundled_robot_path

GOOD = Path(str(bundled_robot_path("hume"))).with_suffix(".toml").read_text()


def fails(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert stop.value.code == 2
    assert out == ""
    assert "Traceback" not in err
    assert err.count("\n") == 1, err
    return err


def project(tmp_path, *changes):
    text = GOOD
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "p.toml"
    path.write_text(text)
    return path


CHANGES = {
    "unknown joint": ('right_hip = -0.4363', 'right_hipp = -0.4363', ["right_hipp", "right_hip"]),
    "unknown actuator joint": ("actuators.joint.right_abduction", "actuators.joint.rabd", ["rabd"]),
    "NaN gain": ("stiffness = 100.0", "stiffness = nan", ["stiffness", "nan"]),
    "infinite spring": ("spring_stiffness = 350.0", "spring_stiffness = inf", ["spring_stiffness"]),
    "negative damping": ("motor_damping = 100.0", "motor_damping = -1.0", ["motor_damping", "-1"]),
    "zero damping": ("motor_damping = 100.0", "motor_damping = 0.0", ["motor_damping", "0"]),
    "missing damping": ("motor_damping = 100.0", "", ["motor_damping", "left_hip"]),
    "wrong length": ("stiffness = 100.0", "stiffness = [1.0, 2.0]", ["shape", "3"]),
    "negative gain": ("stiffness = 50.0", "stiffness = -50.0", ["stiffness"]),
    "20-second delay": ("mean_ms = 20.0", "mean_ms = 20000.0", ["mean_ms", "unit"]),
    "amplitude beyond mean": ("amplitude_ms = 10.0", "amplitude_ms = 30.0", ["amplitude"]),
    "unknown key": ("inertia_shaping = 0.5", "inertia_shapping = 0.5", ["inertia_shapping"]),
    "unknown frame": ('frame = "right_foot"', 'frame = "right_fot"', ["right_fot", "right_foot"]),
    "unknown kind": ('kind = "point"', 'kind = "line"', ["kind", "line"]),
    "unknown feedback": ('feedback = "motor"', 'feedback = "engine"', ["feedback", "engine"]),
    "missing section": ("[robot]", "[robott]", ["robot"]),
    "missing URDF": ("bundled:hume.urdf", "nowhere.urdf", ["nowhere.urdf"]),
    "not TOML": ("[robot]", "[robot", ["TOML"]),
    "unknown gait key": ("apex_speed = 0.5", "apexspeed = 0.5", ["apexspeed", "apex_speed"]),
    "impossible gait": ("transfer_time = 0.06", "transfer_time = 0.34", ["60 %"]),
    "unknown means": ('prediction = "model"', 'prediction = "magic"', ["prediction", "magic"]),
    "text for a means": ("task_damping = 0.5", 'task_damping = "much"', ["task_damping", "much"]),
    "one foot": ('feet = ["left_foot", "right_foot"]', 'feet = ["left_foot"]', ["feet"]),
    "unknown terrain": ('kind = "paper"', 'kind = "moon"', ["terrain", "moon"]),
    "text for number": ("rotor_inertia = 0.093", 'rotor_inertia = "heavy"', ["rotor_inertia"]),
}  # fmt: skip


@pytest.mark.parametrize("name", CHANGES)
def test_project_problem_is_named(name, tmp_path, capsys):
    old, new, words = CHANGES[name]
    err = fails(capsys, "certify", project(tmp_path, (old, new)))
    assert "p.toml" in err or name == "missing URDF"
    for word in words:
        assert word in err


def test_good_project_is_not_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["certify", str(project(tmp_path)), "--json", "--out", str(tmp_path / "c.json")])
    assert stop.value.code == 1
    assert capsys.readouterr().err == ""


def test_huge_and_missing_projects(tmp_path, capsys):
    path = tmp_path / "huge.toml"
    with open(path, "wb") as file:
        file.truncate(50_000_000)
    assert "MB" in fails(capsys, "certify", path)
    assert "missing.toml" in fails(capsys, "certify", tmp_path / "missing.toml")
    assert "cannot be read" in fails(capsys, "certify", tmp_path)
    assert "hume" in fails(capsys, "certify", "bundled:humee")


URDFS = {
    "empty": ("", "empty"),
    "not XML": ("<robot", "XML"),
    "not a robot": ("<html></html>", "not a URDF"),
    "no joints": ('<robot name="r"><link name="a"/></robot>', "no joints"),
    "no mass": (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>',
        "mass",
    ),
    "dangling joint": (
        '<robot name="r"><link name="a"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/></joint></robot>',
        "",
    ),
}


@pytest.mark.parametrize("name", URDFS)
def test_urdf_problem_is_named(name, tmp_path, capfd):
    text, word = URDFS[name]
    urdf = tmp_path / "r.urdf"
    urdf.write_text(text)
    err = fails(capfd, "init", urdf, "--out", tmp_path / "o.toml")
    assert "r.urdf" in err
    assert word in err
    assert not (tmp_path / "o.toml").exists()


@pytest.fixture(scope="module")
def walk():
    from sealag.locomotion import paper_terrain, plan_walk, walk_motion

    system = load("bundled:hume")
    return system, walk_motion(system.robot, plan_walk(paper_terrain(), steps=1), rate=50.0)


def spoil_nan(table):
    table["left_knee"][3] = np.nan
    return table


def spoil_quaternion(table):
    table["base_qw"] *= 2.0
    return table


def spoil_time(table):
    table["time_s"][5] = table["time_s"][4]
    return table


MOTIONS = {
    "unknown column": (lambda t: {**t, "elbow": t["left_knee"]}, "elbow"),
    "missing column": (lambda t: {k: v for k, v in t.items() if k != "left_knee"}, "left_knee"),
    "NaN row": (spoil_nan, "row 4"),
    "quaternion": (spoil_quaternion, "quaternion"),
    "time": (spoil_time, "increase"),
    "lengths": (lambda t: {**t, "left_knee": t["left_knee"][:-1]}, "length"),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_problem_is_named(name, walk, tmp_path, capsys):
    system, motion = walk
    spoil, word = MOTIONS[name]
    path = tmp_path / "m.npz"
    table = {key: value.copy() for key, value in motion_table(motion, system.robot).items()}
    np.savez(path, **spoil(table))
    err = fails(capsys, "certify", "bundled:hume", "--motion", path, "--out", tmp_path / "c.json")
    assert "m.npz" in err
    assert word in err
    assert not (tmp_path / "c.json").exists()


def test_motion_files_that_are_none(tmp_path, capsys):
    for name, content in (("a.csv", "hello\n"), ("b.npz", "x"), ("c.parquet", "x"), ("d.txt", "x")):
        (tmp_path / name).write_text(content)
        assert name in fails(capsys, "certify", "bundled:hume", "--motion", tmp_path / name)
    assert "e.csv" in fails(capsys, "certify", "bundled:hume", "--motion", tmp_path / "e.csv")


def test_unwritable_output(tmp_path, capsys, walk):
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert "cannot be written" in fails(
        capsys, "certify", "bundled:hume", "--out", blocked / "c.json"
    )


def test_wrong_options(capsys, tmp_path):
    assert "criterion" in fails(capsys, "certify", "bundled:hume", "--criterion", "maybe")
    assert "cannot be read" in fails(capsys, "verify", tmp_path / "none.json")


def test_saved_motion_comes_back(walk, tmp_path):
    from sealag.design import load_motion

    system, motion = walk
    for ending in (".csv", ".npz", ".parquet"):
        path = tmp_path / f"m{ending}"
        save_motion(motion, system.robot, path)
        back = load_motion(path, system.robot, contacts=system.contacts)
        np.testing.assert_allclose(back.q, motion.q, atol=1e-15)
        np.testing.assert_allclose(back.v, motion.v, atol=1e-15)
        held = [[c.frame for c in back.contact_sets[i]] for i in back.contact_index]
        assert held == [[c.frame for c in motion.contact_sets[i]] for i in motion.contact_index]
