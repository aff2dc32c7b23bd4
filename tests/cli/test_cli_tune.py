"""`sealag tune`: gains in words, in JSON and in the project file, which is certified then."""

import json
import tomllib

import pytest

from helpers.designs import EXAMPLES

GO2, ANYMAL, PANDA = (EXAMPLES / f"{name}.toml" for name in ("go2", "anymal", "panda"))


def comments(text):
    """The comments of a TOML text without strings that hold a number sign."""
    return [line.split("#", 1)[1].strip() for line in text.splitlines() if "#" in line]


@pytest.fixture
def copy(tmp_path):
    """Copies an example."""

    def of(path):
        target = tmp_path / path.name
        target.write_bytes(path.read_bytes())
        return target

    return of


@pytest.mark.parametrize(
    ("example", "options"),
    [
        (ANYMAL, ["--safety", "1.2"]),
        (ANYMAL, ["--share", "direction"]),
        (ANYMAL, ["--aim", "damping"]),
        (GO2, ["--aim", "damping"]),
        (GO2, ["--share", "direction"]),
        (GO2, ["--limit", "bandwidth=4Hz"]),
        (ANYMAL, ["--aim", "damping", "--limit", "bandwidth=19Hz"]),
        (GO2, ["--aim", "bandwidth,damping-ratio=0.7"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_what_is_written_is_certified(example, options, copy, cli, tmp_path):
    project = copy(example)
    before = project.read_text()
    code, text, err = cli("tune", project, *options, "--write", project, "--json")
    assert (code, err) == (0, "")
    answer, after = json.loads(text), project.read_text()
    assert after != before
    assert comments(after) == comments(before)
    code, text, _ = cli("certify", project, "--json", "--out", tmp_path / "c.json")
    assert code == 0
    certified = json.loads(text)
    assert certified["max_delay_s"] == pytest.approx(answer["reached_s"], rel=1e-9)
    assert certified["hashes"]["project"] == answer["certificate"]["hashes"]["project"]
    assert cli("verify", tmp_path / "c.json", "--project", project)[0] == 0
    again = json.loads(cli("tune", project, *options, "--json")[1])
    for name in {"kp", "kd", "D_theta"} & set(answer):
        assert again[name] == pytest.approx(answer[name], rel=1e-4)


def test_an_answer_in_words(copy, cli):
    code, text, err = cli("tune", GO2)
    assert (code, err) == (0, "")
    assert "factor of all stiffness    3.75" in text
    assert "stopped by                 delay at " in text
    assert "certified" in text


@pytest.mark.parametrize(
    ("number", "words"), [("constant", "every constant delay"), ("jitter", "varies as it likes")]
)
def test_what_a_number_promises_stands_beside_the_certificate(number, words, tmp_path, cli):
    """Damping in the controller has no certificate, and is found all the same."""
    text = GO2.read_text().replace('damping_at = "drive" ', 'damping_at = "controller" ')
    text = text.replace("sample_time_ms = 2.0", "sample_time_ms = 0.2")
    project = tmp_path / "go2.toml"
    project.write_text(text.replace("value_ms = 5.0", "value_ms = 0.2"))
    code, text, _ = cli("tune", project, "--aim", "bandwidth=20", "--number", number)
    assert code == 0
    assert words in text
    assert "not certified (of the passive number, not asked for)" in text


def test_a_limit_in_words(cli):
    code, text, err = cli("tune", ANYMAL, "--aim", "damping", "--limit", "bandwidth=20.5Hz")
    assert (code, err) == (1, "")
    assert "the limit bandwidth 20.5 Hz leaves" in text
    code, text, err = cli("tune", ANYMAL, "--limit", "bandwidth=2Hz")
    assert (code, err) == (0, "")
    assert "bandwidth of the torque    2 Hz at " in text
    assert "(limit 2 Hz)" in text


def test_a_file_beside_the_project(copy, cli, tmp_path):
    project, other = copy(GO2), tmp_path / "stiff.toml"
    before = project.read_bytes()
    assert cli("tune", project, "--write", other)[0] == 0
    assert project.read_bytes() == before
    assert tomllib.loads(other.read_text())["controller"]["kp"] == pytest.approx(150.0, rel=1e-5)


def test_no_gain_is_a_no(copy, cli):
    project = copy(GO2)
    before = project.read_bytes()
    code, text, _ = cli("tune", project, "--aim", "bandwidth=3000", "--write", project)
    assert code == 1
    assert text.startswith("not tuned ")
    assert "not tuned because" in text
    assert project.read_bytes() == before
    code, text, _ = cli("tune", PANDA, "--json")
    answer = json.loads(text)
    assert (code, answer["found"], answer["scale"], answer["binding"]) == (1, False, None, None)
    assert "jitter" in answer["reasons"][0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--aim", "speed"], "'speed'"),
        (["--aim", "bandwidth=fast"], "bandwidth=NUMBER"),
        (["--aim", "stiffness=3"], "bandwidth=NUMBER"),
        (["--aim", "bandwidth=-3"], "bandwidth is -3"),
        (["--number", "exact"], "'exact'"),
        (["--share", "joint"], "'joint'"),
        (["--safety", "0.5"], "safety is 0.5"),
        (["--safety", "nan"], "safety is nan"),
        (["--aim", "bandwidth,damping-ratio=-1"], "damping_ratio is -1"),
        (["--aim", "bandwidth,speed=3"], "bandwidth=NUMBER"),
        (["--aim", "damping,damping-ratio=1"], "bandwidth=NUMBER"),
        (["--limit", "bandwidth=fast"], "bandwidth=NUMBER (Hz)"),
        (["--limit", "bandwidth=3Nm"], "bandwidth=NUMBER (Hz)"),
        (["--aim", "shaping"], "embedded_period_ms"),
        (["--aim", "shaping", "--limit", "bandwidth=3"], "limit bandwidth is for --aim"),
        (["--limit", "noise=3"], "noise is for --aim shaping"),
        (["--limit", "3"], "bandwidth=NUMBER (Hz)"),
        (["--limit", "rms=1Nm"], "--motion"),
        (["--limit", "bandwidth=1", "--limit", "bandwidth=2Hz"], "twice"),
        (["--limit", "bandwidth=1", "--number", "jitter"], "passive"),
        (["--delay-ms", "1"], "2.000 ms"),
        (["--delay-ms", "-1"], "delay"),
        (["--delay-ms", "nan"], "delay"),
        (["--aim", "drag"], "motion"),
        (["--share", "task", "--aim", "damping"], "common"),
        (["--share", "task", "--number", "jitter"], "common"),
        (["--motion", "none.csv"], "none.csv"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_question_without_an_answer_is_one_sentence(options, words, cli):
    code, out, err = cli("tune", GO2, *options)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err


def test_joint_pd_is_what_has_a_bandwidth(cli):
    code, out, err = cli("tune", ANYMAL, "--aim", "bandwidth")
    assert (code, out) == (2, "")
    assert "joint PD" in err


def test_files_that_are_not_written(copy, cli, tmp_path):
    project = copy(GO2)
    urdf = tmp_path / "robot.urdf"
    cases = [
        (["--write", tmp_path / "elsewhere" / "x.toml"], "folder"),
        (["--write", project, "--delay-ms", "5"], "longer"),
        (["--write", tmp_path], "regular file"),
    ]
    for options, words in cases:
        code, out, err = cli("tune", project, *options)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert words in err
    assert not urdf.exists()
    code, _, err = cli("tune", "bundled:hume", "--write", "hume.toml")
    assert code == 2
    assert "folder" in err


def test_tasks_stiffer_than_springs_have_no_damping(tmp_path, cli):
    project = tmp_path / "stiff.toml"
    project.write_text(ANYMAL.read_text().replace("stiffness = 100.0", "stiffness = 1e5"))
    code, text, err = cli("tune", project, "--aim", "damping")
    assert (code, err) == (1, "")
    assert "stiffer than the springs" in text


def test_dotted_keys_that_leave_no_place_are_named(tmp_path, cli):
    project = tmp_path / "dotted.toml"
    dotted = "[actuators]\njoint.LF_HAA.motor_damping = 30.0\n[actuators.default]"
    project.write_text(ANYMAL.read_text().replace("[actuators.default]", dotted))
    before = project.read_bytes()
    code, out, err = cli("tune", project, "--aim", "damping", "--write", project)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "dotted" in err
    assert project.read_bytes() == before


@pytest.mark.parametrize(
    "actuators",
    [
        "[actuators]\ndefault = {{ {keys} }} # all\n"
        "joint = {{ LF_HAA = {{ motor_damping = 9.0 }} }}\n",
        "actuators = {{ default = {{ {keys} }} }} # all\n",
        "[actuators]\ndefault = {{ {keys} }} # all\n"
        "[actuators.joint.LF_HAA]\nmotor_damping = 9.0\n",
    ],
    ids=["a table of joints", "a table of all", "joints below"],
)
def test_inline_tables_of_actuators_take_the_damping(actuators, tmp_path, cli):
    text = ANYMAL.read_text()
    section = text[text.index("[actuators.default]") : text.index("[[contacts]]")]
    keys = ", ".join(line.split("#")[0].strip() for line in section.splitlines()[1:] if line)
    project = tmp_path / "inline.toml"
    project.write_text(actuators.format(keys=keys) + text.replace(section, ""))
    code, out, err = cli("tune", project, "--aim", "damping", "--write", project, "--json")
    assert (code, err) == (0, "")
    after = tomllib.loads(project.read_text())["actuators"]
    found = {name: entry["motor_damping"] for name, entry in after["joint"].items()}
    assert found == json.loads(out)["D_theta"]
    assert "# all" in project.read_text()


def test_windows_line_ends_and_a_table_of_gains_stay(tmp_path, cli):
    legs = [
        f"{leg}_{part}_joint"
        for leg in ("FL", "FR", "RL", "RR")
        for part in ("hip", "thigh", "calf")
    ]
    table = "".join(f"{name} = 40.0  # of {name}\n" for name in legs)
    text = GO2.read_text().replace("kp = 40.0 ", "# kp below ")
    text = text.replace("[delays]", f"[controller.kp]\n{table}[delays]")
    project = tmp_path / "go2.toml"
    project.write_bytes(text.replace("\n", "\r\n").encode())
    assert cli("tune", project, "--write", project)[0] == 0
    after = project.read_bytes().decode()
    assert after.count("\n") == after.count("\r\n") == text.count("\n")
    assert comments(after) == comments(text)
    assert tomllib.loads(after)["controller"]["kp"][legs[3]] == pytest.approx(150.0, rel=1e-5)
