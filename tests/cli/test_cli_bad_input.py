"""Bad input: one sentence that names file, key and remedy, exit status 2, never a traceback."""

import json
import os
import sys
import time

import numpy as np
import pytest

from helpers.robots import urdf_path
from helpers.source import ROOT
from sealag.cli import main
from sealag.design import load

GOOD = urdf_path("bundled:hume.urdf").with_suffix(".toml").read_text()


def fails(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert stop.value.code == 2
    if "--json" in arguments:
        assert json.loads(out)["status"] == "error"
    else:
        assert out == ""
    assert "Traceback" not in err
    assert err.count("\n") == 1, err
    assert len(err) < 2100
    return err


def project(tmp_path, *changes):
    text = GOOD
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "p.toml"
    path.write_text(text)
    return path


SINUSOID = next(line for line in GOOD.splitlines() if line.startswith("central_round_trip"))

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
    "table without end": (
        SINUSOID,
        'central_round_trip = { kind = "table", time_s = [-1e308, 1e308], delay_ms = [1.0, 2.0] }',
        ["time_s", "1e+12"],
    ),
    "20-second delay": ("mean_ms = 20.0", "mean_ms = 20000.0", ["mean_ms", "unit"]),
    "amplitude beyond mean": ("amplitude_ms = 10.0", "amplitude_ms = 30.3",
        ["amplitude 30.3 ms", "mean 20 ms"]),
    "sinusoid too long": ("mean_ms = 20.0, amplitude_ms = 10.0",
        "mean_ms = 5000, amplitude_ms = 5000",
        ["largest delay is 10000 ms (10 s), longer than 5000 ms"]),
    "unknown key": ("inertia_shaping = 0.5", "inertia_shapping = 0.5", ["inertia_shapping"]),
    "unknown frame": ('frame = "right_foot"', 'frame = "right_fot"', ["right_fot", "right_foot"]),
    "push on no frame": ("[delays]", '[[simulation.pushes]]\nframe = "torsoo"\n'
        "force_n = [1.0, 0.0, 0.0]\nstart_s = 0.0\nduration_s = 0.1\n[delays]",
        ["simulation.pushes", "'torsoo'", "torso"]),
    "unknown kind": ('kind = "point"', 'kind = "line"', ["kind", "line"]),
    "unknown feedback": ('feedback = "motor"', 'feedback = "engine"', ["feedback", "engine"]),
    "missing section": ("[robot]", "[robott]", ["robot"]),
    "missing URDF": ("bundled:hume.urdf", "nowhere.urdf", ["nowhere.urdf"]),
    "not TOML": ("[robot]", "[robot", ["TOML"]),
    "unknown gait key": ("apex_speed = 0.5", "apexspeed = 0.5", ["apexspeed", "apex_speed"]),
    "impossible gait": ("transfer_time = 0.06", "transfer_time = 0.34", ["60 %"]),
    "unknown means": ('prediction = "model"', 'prediction = "magic"',
        ["walking.options.prediction", "magic", "none, velocity or model"]),
    "text for a means": ("task_damping = 0.5", 'task_damping = "much"',
        ["walking.options.task_damping", "much", "0 … 1000"]),
    "number for a means": ("lead = true", "lead = 1", ["walking.options.lead", "true or false"]),
    "true for a gain": ("task_damping = 0.5", "task_damping = true",
        ["walking.options.task_damping"]),
    "hurry": ("apex_speed = 0.5", "apex_speed = 50", ["walking.gait.apex_speed", "20 m/s"]),
    "one foot": ('feet = ["left_foot", "right_foot"]', 'feet = ["left_foot"]', ["feet"]),
    "unknown terrain": ('kind = "paper"', 'kind = "moon"', ["terrain", "moon"]),
    "text for number": ("rotor_inertia = 0.093", 'rotor_inertia = "heavy"', ["rotor_inertia"]),
    "number in quotes": ("rotor_inertia = 0.093", 'rotor_inertia = "0.093"', ["without quotes"]),
    "true for number": ("motor_damping = 100.0", "motor_damping = true", ["True", "a number"]),
    "joint in quotes": ("right_hip = -0.4363", 'right_hip = "-0.4363"', ["right_hip"]),
    "tiny spring": ("spring_stiffness = 350.0", "spring_stiffness = 1e-308", ["Nm/rad", "0.001"]),
    "hard spring": ("spring_stiffness = 350.0", "spring_stiffness = 1e12", ["Nm/rad", "1e+08"]),
    "one bad gain": ("stiffness = 50.0", "stiffness = [1, 2, -3]", ["torso", "entry 3", "-3"]),
    "delay as number": (SINUSOID, "central_round_trip = 8.0", ["central_round_trip", "a table"]),
    "delay of no kind": ('{ kind = "sinusoid", mean', "{ mean", ["trip.kind", "missing"]),
    "delay of odd kind": ('kind = "sinusoid"', 'kind = "Constant"', ["'Constant'", "'samples'"]),
    "short position": ("[0.0, 0.0, 0.87]", "[0.0, 0.87]", ["base_position", "3 entries"]),
    "long quaternion": ("[posture.joints]", "base_quaternion_xyzw = [0, 0, 0, 2]\n[posture.joints]",
        ["base_quaternion_xyzw", "length 2"]),
    "degrees": ("right_knee = 0.9599", "right_knee = 55.0", ["right_knee", "55 degrees", "0.9599"]),
    "held and fixed": ('base = "floating"', 'base = "fixed"', ["robot.base", "[[contacts]]"]),
    "contact twice": ('frame = "left_foot"', 'frame = "right_foot"', ["right_foot", "twice"]),
    "com with a frame": ('kind = "com"', 'kind = "com"\nframe = "torso"', ["centre", "frame"]),
    "axis twice": ('kind = "com"', 'kind = "com"\naxes = ["x", "x"]', ["centre of mass", "twice"]),
    "endless burst": (SINUSOID, 'central_round_trip = { kind = "constant", value_ms = 1.0, '
        "packet_loss = 0.1, max_burst = 1000000000 }\nsample_time_ms = 1.0",
        ["max_burst", "5000 ms"]),
    "fast drives": (SINUSOID, SINUSOID + "\nsample_time_ms = 1\nembedded_period_ms = 30.3",
        ["30.3 ms is longer than the central one, 1 ms"]),
    "no samples": (SINUSOID,
        'central_round_trip = {kind = "samples", period_s = 1, file = "no.txt"}',
        ["central_round_trip", "no.txt"]),
    "no motion": ("[delays]", '[motion]\nfile = "no.csv"\n[delays]', ["motion.file", "no.csv"]),
    "endless integer": ("steps = 7", "steps = " + 5000 * "1", ["a whole number", "19"]),
    "long integer": ("steps = 7", "steps = " + 400 * "1", ["walking.steps", "at most 19"]),
    "endless hexadecimal": ("motor_damping = 100.0", "motor_damping = 0x" + 5000 * "f",
        ["actuators.default.motor_damping", "at most 19"]),
    "long integer for text": ('kind = "com"', 'kind = 0x' + 5000 * "f", ["tasks", "at most 19"]),
    "long burst": (SINUSOID, 'central_round_trip = { kind = "constant", value_ms = 1.0, '
        f"packet_loss = 0.1, max_burst = {2**63 - 1} }}", ["max_burst", "1e+09"]),
    "folder for URDF": ("bundled:hume.urdf", ".", ["robot", "Is a directory"]),
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


def test_project_in_another_encoding_is_named(tmp_path, capsys):
    path = project(tmp_path)
    path.write_bytes(b"# first\n# \xe9\n" + path.read_bytes())
    assert "line 2 is not in UTF-8" in fails(capsys, "certify", path)


def test_project_with_byte_order_mark_is_read(tmp_path):
    path = project(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load(path).robot.name == load("bundled:hume").robot.name


SAMPLES = {
    "empty": ("\n", "empty"),
    "two columns": ("8.0\n0.1 8.0\n", "line 2"),
    "seconds or worse": ("1e4\n", "10000 ms"),
    "negative": ("-3.3\n", "-3.3 ms"),
}


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_problem_is_named(name, tmp_path, capsys):
    samples = 'central_round_trip = { kind = "samples", file = "s.txt", period_s = 0.01 }'
    path = project(tmp_path, (SINUSOID, samples))
    (tmp_path / "s.txt").write_text("\ufeff8.0\n\n9.5\n")
    assert load(path).delays.central.upper_bound == pytest.approx(9.5e-3)
    text, word = SAMPLES[name]
    (tmp_path / "s.txt").write_text(text)
    err = fails(capsys, "certify", path)
    assert "p.toml: delays.central_round_trip" in err
    assert word in err


def body(mass="1", ixx="0.01"):
    return (
        f'<link name="b"><inertial><mass value="{mass}"/><origin xyz="0 0 .1"/><inertia ixx="{ixx}"'
        ' iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def arm(link=None, *, kind="revolute", limit='lower="-1" upper="1"', more=""):
    inner = f'<limit {limit} effort="1" velocity="1"/>' if limit else ""
    return (
        f'<robot name="r"><link name="a"/>{body() if link is None else link}'
        f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>'
        f"{inner}</joint>{more}</robot>"
    )


FINGER = (
    body().replace('"b"', '"c"')
    + '<joint name="k" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="j"/></joint>'
)

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
        "j",
    ),
    "text for a mass": (arm(body(mass="heavy")), "heavy"),
    "comma in a mass": (arm(body(mass="1,5")), "link b"),
    "NaN inertia": (arm(body(ixx="nan")), "ixx"),
    "negative inertia": (arm(body(ixx="-1")), "link b"),
    "almost no inertia": (
        arm(body(mass="1e-12", ixx="1e-15").replace("0.01", "1e-15")),
        "almost no inertia",
    ),
    "no limit": (arm(limit=""), "limits"),
    "SDF": ('<sdf version="1.6"/>', "convert it to a URDF"),
    "odd type": (arm(kind="hinge"), "hinge"),
    "zero axis": (arm().replace("0 1 0", "0 0 0"), "axis of joint j"),
    "link twice": (arm(more='<link name="a"/>'), "2 links"),
    "xacro": (arm(more="<xacro:if/>"), "cannot be expanded by xacro"),
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


def test_a_massless_base_is_fixed_and_does_not_float(tmp_path, capfd):
    urdf, out = tmp_path / "r.urdf", tmp_path / "o.toml"
    urdf.write_text(arm())
    err = fails(capfd, "init", urdf, "--base", "floating", "--out", out)
    assert "link a has almost no inertia" in err
    assert "(init --base fixed)" in err
    with pytest.raises(SystemExit) as stop:
        main(["init", str(urdf), "--base", "fixed", "--out", str(out)])
    assert stop.value.code == 0
    assert 'base = "fixed"' in out.read_text()


def test_good_arm_is_not_refused_and_mimics_have_no_actuator(tmp_path):
    from sealag.errors import RobotError
    from sealag.robot import load_robot

    path = tmp_path / "r.urdf"
    path.write_text(arm(more=FINGER))
    assert load_robot(path, floating_base=False).joints == ("j",)
    with pytest.raises(RobotError, match="k mimics j"):
        load_robot(path, floating_base=False, actuated=["j", "k"])


@pytest.fixture(scope="module")
def walk():
    from sealag.walking import GroundProfile, WalkPlan

    system = load("bundled:hume")
    return system, WalkPlan.over(GroundProfile.paper(), steps=1).motion(system.robot, rate=50.0)


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
    "other contact": (lambda t: {**t, "contact:elbow": 0.0 * t["time_s"]}, "no contact of the"),
    "missing column": (lambda t: {k: v for k, v in t.items() if k != "left_knee"}, "left_knee"),
    "NaN row": (spoil_nan, "row 4"),
    "quaternion": (spoil_quaternion, "quaternion"),
    "time": (spoil_time, "increase"),
    "joint limit": (lambda t: {**t, "left_knee": t["left_knee"] + 55.0}, "left_knee"),
    "half a contact": (lambda t: {**t, "contact:left_foot": 0.5 + 0.0 * t["time_s"]}, "0 or 1"),
    "some velocities": (lambda t: {k: v for k, v in t.items() if k != "base_vx"}, "base_vx"),
    "complex": (lambda t: {**t, "left_knee": t["left_knee"] * 1j}, "complex"),
    "lengths": (lambda t: {**t, "left_knee": t["left_knee"][:-1]}, "length"),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_problem_is_named(name, walk, tmp_path, capsys):
    system, motion = walk
    spoil, word = MOTIONS[name]
    path = tmp_path / "m.npz"
    system.save_motion(motion, path)
    with np.load(path) as table:
        spoiled = spoil(dict(table))
    np.savez(path, **spoiled)
    err = fails(capsys, "certify", "bundled:hume", "--motion", path, "--out", tmp_path / "c.json")
    assert "m.npz" in err
    assert word in err
    assert not (tmp_path / "c.json").exists()


def test_motion_files_that_are_none(tmp_path, capsys):
    for name, content in (("a.csv", "hello\n"), ("b.npz", "x"), ("c.parquet", "x"), ("d.txt", "x")):
        (tmp_path / name).write_text(content)
        assert name in fails(capsys, "certify", "bundled:hume", "--motion", tmp_path / name)
    assert "e.csv" in fails(capsys, "certify", "bundled:hume", "--motion", tmp_path / "e.csv")


CSVS = {
    "comment": (lambda lines: [lines[0], "#" + lines[1], *lines[2:]], "row 1"),
    "text": (lambda lines: [*lines[:3], "a" + lines[3]], "row 3"),
    "short row": (lambda lines: [*lines[:3], lines[3].rpartition(",")[0]], "row 3"),
    "semicolons": (lambda lines: [line.replace(",", ";") for line in lines], "semicolons"),
    "tabs": (lambda lines: [line.replace(",", "\t") for line in lines], "tabs"),
    "no names": (lambda lines: lines[1:], "column names"),
    "a comment first": (lambda lines: ["# log of hume", *lines], "column names"),
    "no rows": (lambda lines: lines[:1], "no rows"),
    "name twice": (lambda lines: [line + "," + line.split(",")[0] for line in lines], "twice"),
}


@pytest.mark.parametrize("name", CSVS)
def test_csv_problem_is_named(name, walk, tmp_path, capsys):

    system, motion = walk
    path = tmp_path / "m.csv"
    system.save_motion(motion, path)
    good = path.read_text()
    path.write_text("\ufeff" + good.replace("\n", "\r\n"))
    assert len(system.load_motion(path)) == len(motion)
    spoil, word = CSVS[name]
    path.write_text("\n".join(spoil(good.splitlines())))
    err = fails(capsys, "certify", "bundled:hume", "--motion", path)
    assert "m.csv" in err
    assert word in err


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("times", [(-1e308, 1e308), (0.0, 5e-324)])
def test_times_without_velocities_are_named(times, walk, tmp_path, capsys):
    system, motion = walk
    path = tmp_path / "m.npz"
    base = ("x", "y", "z", "qx", "qy", "qz", "qw")
    names = [*(f"base_{name}" for name in base), *system.robot.joints]
    columns = dict(zip(names, motion.q[[0, 5]].T, strict=True))
    np.savez(path, time_s=np.array(times), **columns)
    err = fails(capsys, "certify", "bundled:hume", "--motion", path)
    assert "m.npz" in err
    assert "time_s" in err


def test_many_column_names_are_refused_at_once(tmp_path, capsys):
    path = tmp_path / "wide.csv"
    path.write_text(",".join(f"c{k}" for k in range(300_000)) + "\n")
    start = time.monotonic()
    assert "lacks the column time_s" in fails(capsys, "certify", "bundled:hume", "--motion", path)
    assert time.monotonic() - start < 30.0


def test_a_named_pipe_is_refused_and_not_waited_for(tmp_path, capsys):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    for command in (["certify"], ["verify"], ["verify", "--second"]):
        assert "not a regular file" in fails(capsys, *command, path)


def test_nothing_read_is_overwritten(tmp_path, capsys):
    path = project(tmp_path)
    before = path.read_text()
    for command in ("certify", "simulate"):
        for out in (path, tmp_path / "." / "p.toml", tmp_path, "/dev/null"):
            assert str(out) in fails(capsys, command, path, "--json", "--out", out)
    assert path.read_text() == before
    assert "regular" in fails(capsys, "certify", "/dev/zero")


def test_unwritable_output(tmp_path, capsys, walk):
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert "cannot be written" in fails(
        capsys, "certify", "bundled:hume", "--out", blocked / "c.json"
    )


def test_wrong_options(capsys, tmp_path):
    assert "criterion" in fails(capsys, "certify", "bundled:hume", "--criterion", "maybe")
    assert "cannot be read" in fails(capsys, "verify", tmp_path / "none.json")


USAGE = {
    "unknown command": (["frobnicate"], "frobnicate"),
    "unknown option": (["certify", "bundled:hume", "--nope"], "--nope"),
    "missing argument": (["certify"], "sealag certify --help"),
    "text for a number": (["simulate", "bundled:hume", "--seed", "x"], "--seed"),
    "negative seed": (["simulate", "bundled:hume", "--seed", "-1"], "seed is -1"),
    "no scenario": (["simulate", "bundled:hume", "--scenario", ""], "scenario is ''"),
    "no end": (["simulate", "bundled:hume", "--duration", "1e300"], "1e9 s"),
    "no memory": (["simulate", "bundled:hume", "--duration", "1e8"], "GB"),
    "a file for a folder": (
        ["certify", "bundled:hume", "--out", f"{ROOT / 'README.md'}/c.json"],
        "its folder is a file",
    ),
    "ten digits": (["certify", "bundled:hume", "--proofs", "9999999999"], "9 digits"),
    "late": (["simulate", "bundled:hume", "--delay-scale", "1e9"], "--delay-scale"),
    "early": (["simulate", "bundled:hume", "--delay-scale", "-1"], "--delay-scale"),
    "no horizon": (["margin", "bundled:hume", "--horizon-ms", "1e300"], "--horizon-ms"),
    "device": (["verify", "/dev/zero"], "regular"),
    "endless number": (["simulate", "bundled:hume", "--seed", 5000 * "1"], "--seed"),
    "endless proofs": (["certify", "bundled:hume", "--proofs", 5000 * "1"], "from 1 up"),
    "long name": (["certify", "bundled:hume", "--criterion", 10**5 * "x"], "--criterion"),
    "no folder": (["paper", "--out", "/dev/null"], "cannot be made"),
    "no walk": (
        ["paper", str(ROOT / "examples/anymal.toml"), "--out", "page"],
        "no [walking] section",
    ),
    "no project": (["paper", "nowhere.toml", "--out", "page"], "nowhere.toml"),
    "one instant": (["certify", "bundled:hume", "--time-varying"], "more than one instant"),
}


def test_a_study_that_is_not_installed_is_named(capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "humanoids2016", None)
    assert "not installed" in fails(capsys, "paper", "--out", tmp_path)


@pytest.mark.parametrize("name", USAGE)
def test_usage_problem_is_one_sentence(name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, word = USAGE[name]
    assert word in fails(capsys, *arguments)
    assert list(tmp_path.iterdir()) == []


def test_pushes_that_do_not_act_are_refused(tmp_path, capsys):
    push = '[[simulation.pushes]]\nframe = "torso"\nforce_n = [1.0, 0.0, 0.0]\n{}\n[delays]'
    path = project(tmp_path, ("[delays]", push.format("start_s = 5.0\nduration_s = 0.1")))
    err = fails(capsys, "simulate", path, "--scenario", "regulate", "--duration", "0.05")
    assert "torso" in err
    assert "ends at" in err
    for times in ("start_s = 0.001\nduration_s = 0.1", "start_s = 0.001\nduration_s = 1e-5"):
        path = project(tmp_path, ("[delays]", push.format(times)))
        with pytest.raises(SystemExit) as stop:
            out = str(tmp_path / "o.mcap")
            main(["simulate", str(path), "--scenario", "drop", "--duration", "0.002", "--out", out])
        assert stop.value.code == 0


def test_help_is_shown_without_a_command(capsys):
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 0
    assert "certify" in capsys.readouterr().out


def test_saved_motion_comes_back(walk, tmp_path):

    system, motion = walk
    for ending in (".csv", ".npz", ".parquet"):
        path = tmp_path / f"m{ending}"
        system.save_motion(motion, path)
        back = system.load_motion(path)
        np.testing.assert_allclose(back.q, motion.q, atol=1e-15)
        np.testing.assert_allclose(back.v, motion.v, atol=1e-15)
        held = [[c.frame for c in back.contact_sets[i]] for i in back.contact_index]
        assert held == [[c.frame for c in motion.contact_sets[i]] for i in motion.contact_index]
