"""`sealag sweep`: the answer, pictures, and sentences about what is wrong."""

import json

import pytest

from helpers.two_joints import two_joints

HAND = "tasks.hand.stiffness"
DELAY = "delays.central_round_trip.value_ms"
GRID = ["--over", f"{HAND}=20:80:log3", "--over", f"{DELAY}=4,400", "--jobs", "1"]


@pytest.fixture
def project(tmp_path):
    return two_joints(tmp_path)


def test_the_answer_in_words_and_in_json(project, cli, tmp_path):
    out = tmp_path / "o"
    code, text, error = cli("sweep", project, *GRID, "--out", out)
    assert (code, error) == (0, "")
    assert "points                     6, 6 of them computed now" in text
    assert f"dataset                    {out}" in text
    code, text, _ = cli("sweep", project, *GRID, "--out", out, "--json")
    told = json.loads(text)
    assert (code, told["points"], told["computed"], told["refused"]) == (0, 6, 0, 0)
    assert sum(told["verdicts"].values()) == 6
    assert 0.0 < told["smallest"] < told["largest"]


@pytest.mark.parametrize("ending", ["png", "svg", "pdf", "html"])
def test_a_picture_of_each_kind(project, cli, tmp_path, ending):
    picture = tmp_path / f"map.{ending}"
    assert cli("sweep", project, *GRID, "--out", tmp_path / "o", "--plot", picture)[0] == 0
    content = picture.read_bytes()
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF", "html": b"<!doctype html>"}
    assert content.startswith(begins[ending])
    if ending in ("svg", "html"):
        for words in (HAND, f"{DELAY} (ms)", "largest delay, passive bound (ms)"):
            assert words in content.decode()


@pytest.mark.parametrize(
    ("over", "sample", "words"),
    [
        ([f"{HAND}=20:80:lin3"], "grid", "exact local margin (ms)"),
        ([f"{HAND}=-5,20", f"{DELAY}=4"], "grid", HAND),
        ([f"{HAND}=20:80", f"{DELAY}=1:9"], "lhs:5", f"{DELAY} (ms)"),
        ([f"{HAND}=20,80", f"{DELAY}=1,9", "controller.gravity=planned,none"], "grid", "planned"),
        ([f"{HAND}=0,0.0000001"], "grid", HAND),
    ],
    ids=["curve", "with a refused point", "samples", "parallel coordinates", "without numbers"],
)
def test_pictures_of_one_two_and_three_keys(project, cli, tmp_path, over, sample, words):
    options = [word for one in over for word in ("--over", one)]
    picture = tmp_path / "p.svg"
    code, _, error = cli(
        "sweep", project, *options, "--sample", sample, "--ask", "margin",
        "--jobs", 1, "--out", tmp_path / "o", "--plot", picture,
    )  # fmt: skip
    assert (code, error) == (0, "")
    assert words in picture.read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--over", f"{HAND}=1:2"], "how many values"),
        (["--over", f"{HAND}=1,2", "--ask", "fly"], "--ask is 'fly'"),
        (["--over", f"{HAND}=1,2", "--ask", "margin:x=1"], "takes no options"),
        (["--over", f"{HAND}=1,2", "--ask", "tune:x=1"], "tune takes aim"),
        (["--over", f"{HAND}=1,2", "--jobs", "0"], "--jobs"),
        (["--over", f"{HAND}=1,2", "--plot", "p.jpg"], "png, svg, pdf or html"),
        (["--over", f"{HAND}=1,2", "--motion", "none.csv"], "none.csv"),
        (["--over", f"{HAND}=1,2", "--out", "two.urdf"], "cannot be made"),
        ([], "--over"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_what_is_wrong_ends_with_2_and_one_sentence(
    project, cli, tmp_path, monkeypatch, options, said
):
    monkeypatch.chdir(tmp_path)
    code, text, error = cli("sweep", project, *options)
    assert (code, text) == (2, "")
    assert said in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "two.sweep").exists() or not list((tmp_path / "two.sweep").glob("part*"))


def test_a_question_that_no_point_can_answer_says_why(project, cli, tmp_path):
    """A word of --ask that tune does not know; a dataset of refusals is no success."""
    options = ("sweep", project, *GRID, "--ask", "tune:aim=foo", "--out", tmp_path / "o")
    code, text, _ = cli(*options)
    assert code == 2
    assert "first of them            aim is 'foo'; it must be stiffness" in text
    code, text, _ = cli(*options, "--json")
    assert (code, json.loads(text)["refusal"][:13]) == (2, "aim is 'foo';")


def test_yes_and_no_are_said_by_what_was_asked(project, cli, tmp_path):
    code, text, _ = cli("sweep", project, *GRID, "--ask", "bound", "--out", tmp_path / "o")
    assert code == 0
    assert "  not passive " in text
    assert "  passive " in text
    assert "True" not in text
