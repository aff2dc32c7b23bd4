"""`--plot` of the commands that compute a curve: drawn from the answer, refused before the work."""

import json

import pytest

from helpers.designs import EXAMPLES

GO2 = EXAMPLES / "go2.toml"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A short run of the dog, recorded and drawn."""
    from sealag.cli import main

    folder = tmp_path_factory.mktemp("run")
    paths = folder / "go2.mcap", folder / "run.svg"
    with pytest.raises(SystemExit) as end:
        main(["simulate", str(GO2), "--duration", "0.05", "--out", str(paths[0]), "--plot",
              str(paths[1])])  # fmt: skip
    assert not end.value.code
    return paths


def test_a_run_shows_its_audit(recording):
    text = recording[1].read_text()
    for words in ("go2: energy audit", "energy (J)", "time (s)", "injected by the delay"):
        assert words in text


def test_a_certificate_shows_bounds_along_a_motion(recording, cli, tmp_path):
    picture = tmp_path / "c.svg"
    code, text, _ = cli(
        "certify", GO2, "--motion", recording[0], "--out", tmp_path / "c.json", "--plot", picture,
        "--json",
    )  # fmt: skip
    assert code == 0
    assert json.loads(text)["plot"] == str(picture)
    for words in ("passive bound", "local margin", "delay (ms)", "delay of the design: 7 ms"):
        assert words in picture.read_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["margin", "--horizon-ms", 40], ("unstable roots", "constant delay (ms)", "26.25 ms")),
        (["margin", "--rate-sweep"], ("sample rate (Hz)", "delay beside the hold (ms)")),
        (["tune"], ("gains over those found", "required: 7 ms", "found: 1")),
        (["tune", "--aim", "damping"], ("(damping, passive)",)),
        (["tune", "--aim", "bandwidth=30"], ("(bandwidth, passive)",)),
        (["tune", "--aim", "front"], ("trace of the damping (Nms/rad)", "slowest locked joint")),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, list) else "",
)
def test_curves_of_a_posture(options, words, cli, tmp_path):
    picture = tmp_path / "p.svg"
    command, *rest = options
    code, text, error = cli(command, GO2, *rest, "--plot", picture)
    assert (code, error) == (0, "")
    assert str(picture) in text
    for word in words:
        assert word in picture.read_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["certify", "--out", "c.json", "--plot", "c.png"], "bounds along a motion"),
        (["certify", "--out", "c.png", "--plot", "c.jpg"], "png, svg, pdf or html"),
        (["margin", "--plot", "m.png"], "--horizon-ms or --rate-sweep"),
        (["margin", "--rate-sweep", "--plot", "m"], "png, svg, pdf or html"),
        (["tune", "--plot", "t.gif"], "png, svg, pdf or html"),
        (["simulate", "--plot", "s.gif"], "png, svg, pdf or html"),
        (["tune", "--pick", 1], "--aim front"),
        (["tune", "--aim", "front", "--pick", 999], "no point 999"),
        (["tune", "--aim", "front", "--write", "o.toml"], "--pick NUMBER"),
        (["tune", "--aim", "shaping", "--plot", "s.png"], "period"),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, list) else "",
)
def test_what_has_no_curve_is_refused(options, words, cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    project = tmp_path / "go2.toml"
    project.write_text(GO2.read_text())
    command, *rest = options
    code, text, error = cli(command, project, *rest)
    assert (code, text) == (2, "")
    assert words in error
    assert [path.name for path in tmp_path.iterdir()] == ["go2.toml"]


def test_a_point_of_a_front_is_written_and_certified(cli, tmp_path):
    project = tmp_path / "go2.toml"
    project.write_text(GO2.read_text())
    points = json.loads(cli("tune", project, "--aim", "front", "--json")[1])["front"]
    code, text, _ = cli(
        "tune", project, "--aim", "front", "--pick", 2, "--write", project, "--json"
    )
    assert code == 0
    answer = json.loads(text)
    assert answer["scale"] == points[1]["scale"]
    assert answer["D_theta"] == pytest.approx(points[1]["D_theta"])
    code, text, _ = cli("certify", project, "--json", "--out", tmp_path / "c.json")
    assert code == 0
    assert json.loads(text)["max_delay_s"] == pytest.approx(points[1]["delay_s"], rel=1e-4)


@pytest.mark.parametrize(
    ("command", "option"),
    [("certify", "--out"), ("simulate", "--out"), ("tune", "--write"), ("sweep", "--out")],
)
def test_a_picture_never_replaces_the_other_output(command, option, recording, cli, tmp_path):
    """Both were said to be written, and one was there."""
    project, path = tmp_path / "go2.toml", tmp_path / "both.svg"
    project.write_text(GO2.read_text())
    more = {
        "certify": ["--motion", recording[0]],
        "sweep": ["--over", "simulation.seed=1", "--jobs", 1],
    }.get(command, [])
    options = [option, path, "--plot", tmp_path / "." / "both.svg"]
    code, _, error = cli(command, project, *more, *options)
    assert code == 2
    assert "is asked for twice" in error
    assert not path.exists()


def test_a_mapping_in_words_and_in_the_file(cli, tmp_path):
    project = tmp_path / "go2.toml"
    text = GO2.read_text()
    project.write_text(text.replace('damping_at = "drive" ', 'damping_at = "controller" '))
    assert cli("certify", project, "--out", tmp_path / "c.json")[0] == 1
    code, said, _ = cli("tune", project, "--aim", "mapping", "--write", project)
    assert code == 0
    assert "left over                  0.00% of the controller's damping" in said
    assert "jitter margin, central   1.030 ms" in said
    assert 'damping_at = "drive"            # or' in project.read_text()
    assert cli("certify", project, "--out", tmp_path / "c.json")[0] == 0


def test_a_schedule_is_written_beside_its_project_and_certified(recording, cli, tmp_path):
    project, picture = tmp_path / "go2.toml", tmp_path / "s.svg"
    project.write_text(GO2.read_text())
    code, said, _ = cli(
        "tune", project, "--aim", "schedule", "--limit", "rate=2", "--motion", recording[0],
        "--write", project, "--plot", picture,
    )  # fmt: skip
    assert code == 0
    assert "factor along the motion    3.75" in said
    assert "factor of all stiffness (1)" in picture.read_text()
    assert 'file = "go2.schedule.csv"' in project.read_text()
    code, text, _ = cli(
        "certify", project, "--time-varying", "--json", "--out", tmp_path / "c.json"
    )
    assert code == 0
    assert json.loads(text)["time_varying_delay_s"] >= 0.007
