"""`sealag export`: a model for MuJoCo with the design's delays, or a sentence why there is none."""

import json

import mujoco
import pytest

from helpers.designs import EXAMPLES

ANYMAL = EXAMPLES / "anymal.toml"


def test_writes_a_model_that_mujoco_reads(cli, tmp_path):
    path = tmp_path / "new" / "robot.xml"
    code, text, err = cli("export", ANYMAL, "--for", "mujoco", "--out", path)
    assert (code, err) == (0, "")
    assert "5.000 ms, 10 steps" in text
    assert "write ctrl every 5 steps" in text
    assert f"model                      {path}" in text
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.opt.timestep == 5e-4
    assert set(model.actuator_delay) == {0.005}
    assert {int(count) for count, _ in model.actuator_history} == {10}
    assert set(model.sensor_delay) == {0.004}


def test_json_says_all_in_seconds(cli, tmp_path):
    path = tmp_path / "robot.xml"
    code, text, err = cli("export", ANYMAL, "--step-ms", "0.25", "--out", path, "--json")
    answer = json.loads(text)
    assert (code, err) == (0, "")
    assert answer["file"] == str(path)
    assert (answer["timestep_s"], answer["command_steps"], answer["hold_steps"]) == (2.5e-4, 20, 10)
    assert answer["total_s"] == pytest.approx(answer["design_s"]) == pytest.approx(0.0115)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("bundled:hume",), "varies between 5 ms and 15 ms"),
        ((ANYMAL, "--step-ms", "1"), "no multiple of the step 1 ms"),
        ((ANYMAL, "--step-ms", "nan"), "at least 0.001 ms"),
        ((ANYMAL, "--for", "isaac"), "it must be mujoco"),
        ((ANYMAL, "--out", ANYMAL), "is an input and is not overwritten"),
    ],
)
def test_what_cannot_be_is_one_sentence_and_no_file(cli, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    before = ANYMAL.read_bytes()
    code, text, err = cli("export", *arguments)
    assert (code, text) == (2, "")
    assert words in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    assert ANYMAL.read_bytes() == before
