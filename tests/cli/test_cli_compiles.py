"""Kernels are compiled once, with words, and only by commands that compute."""

import os
import subprocess
import sys

import pytest

from helpers.certificates import half_a_step
from helpers.designs import EXAMPLES
from sealag.design import load

HELD = EXAMPLES / "hume_held.toml"


@pytest.fixture
def fresh(monkeypatch):
    """An installation whose cache is empty, as far as the command knows; what it compiles."""
    done = []

    def compile_all(progress, *, missing_only=False):
        assert missing_only
        progress("contact")
        done.append("contact")

    monkeypatch.setattr("sealag.kernels.compiled", lambda: bool(done))
    monkeypatch.setattr("sealag.kernels.compile_all", compile_all)
    return done


def test_the_first_run_says_that_it_compiles_and_the_second_is_silent(fresh, tmp_path, cli):
    out = tmp_path / "c.json"
    for command in (
        ("certify", HELD, "--json", "--out", out),
        ("margin", HELD, "--json"),
        ("simulate", HELD, "--duration", "0.01", "--json", "--out", tmp_path / "run.mcap"),
        ("verify", out, "--project", HELD, "--json"),
    ):
        fresh.clear()
        code, text, err = cli(*command)
        assert code == 0
        assert text.startswith("{")
        assert err.startswith("sealag: compiling its kernels, once")
        assert "sealag: compiling contact\n" in err
        assert fresh == ["contact"]
        code, _, err = cli(*command)
        assert (code, err) == (0, "")
        assert fresh == ["contact"]


def test_refusals_compile_nothing(fresh, tmp_path, cli):
    import sealag

    out, bad, walk = tmp_path / "c.json", tmp_path / "bad.toml", tmp_path / "walk.csv"
    bad.write_text(HELD.read_text().replace("[delays]", "[delay]"))
    hume = load("bundled:hume")
    hume.save_motion(half_a_step(hume), walk)
    text = walk.read_text()
    walk.write_text(text[: len(text) // 2].rpartition(",")[0] + ",nothing\n")
    for command in (
        ("certify", bad),
        ("certify", tmp_path / "none.toml"),
        ("certify", HELD, "--criterion", "best"),
        ("certify", HELD, "--proofs", "0"),
        ("certify", HELD, "--time-varying"),
        ("certify", "bundled:hume", "--motion", walk),
        ("certify", HELD, "--no-such-option"),
        ("margin", HELD, "--horizon-ms", "-1"),
        ("margin", "bundled:hume", "--motion", walk),
        ("simulate", HELD, "--duration", "-1"),
        ("simulate", HELD, "--delay-scale", "-1"),
        ("verify", bad),
        ("verify", bad, "--project", HELD),
        ("init", bad),
    ):
        code, text, err = cli(*command, *(("--out", out) if command[0] == "init" else ()))
        assert (code, text) == (2, ""), command
        assert "compiling" not in err
    assert cli("--help")[0] == 0
    assert fresh == []
    sealag.certify(load(HELD)).write(out)
    assert cli("verify", out)[0] == 0
    assert fresh == [], "a file's own numbers need no kernels"
    assert cli("certify", HELD, "--out", out)[0] == 0
    assert fresh == ["contact"], "the control"


def test_an_empty_cache_stays_empty_until_something_is_computed(tmp_path):
    """In processes of their own: what Numba compiles, it writes into the cache."""
    cache, robot = tmp_path / "cache", tmp_path / "mine.toml"
    cache.mkdir()

    def alone(words, *arguments):
        return subprocess.run(
            [sys.executable, "-c", words, *map(str, arguments)],
            capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path,
            env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        )  # fmt: skip

    command = "from sealag.cli import main; main()"
    urdf = load("bundled:hume").robot.urdf_path
    for status, *arguments in (
        (0, "--help"),
        (0, "init", urdf, "--out", robot),
        (2, "certify", robot),
        (2, "certify", HELD, "--time-varying"),
    ):
        done = alone(command, *arguments)
        assert done.returncode == status, done.stderr
        assert list(cache.rglob("*.nbi")) == []
    alone("import numpy as np, sealag.passivity as p; p.max_delay(*[np.eye(2)] * 4)")
    assert list(cache.rglob("*.nbi")) != [], "the control"
