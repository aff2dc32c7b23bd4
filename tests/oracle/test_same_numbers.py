"""Other linear algebra kernels change last bits, and no verdict, sentence or printed figure."""

import json
import math
import os
import subprocess
import sys
import tempfile
from functools import cache

import pytest

from helpers.designs import EXAMPLES
from helpers.source import ROOT

KERNELS = ("Nehalem", "Haswell")
DIGITS = 1e-6
"""Relative; the command line prints four digits."""

DESIGNS = ("bundled:hume", str(EXAMPLES / "anymal.toml"), str(EXAMPLES / "baxter.toml"))


@cache
def _certified(design, kernel):
    """What a process that uses one set of kernels says."""
    with tempfile.TemporaryDirectory() as folder:
        told = subprocess.run(
            [sys.executable, "-m", "sealag", "certify", design, "--json", "--out", "c.json"],
            capture_output=True, text=True, check=False, cwd=folder,
            env={**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": str(ROOT / "src")},
        )  # fmt: skip
    return told.returncode, json.loads(told.stdout)


def differences(one, other, where=""):
    """Where two answers differ by more than printed figures show."""
    if isinstance(one, dict) and isinstance(other, dict) and set(one) == set(other):
        return [gap for key in one for gap in differences(one[key], other[key], f"{where}.{key}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other))
        return [gap for k, (a, b) in pairs for gap in differences(a, b, f"{where}[{k}]")]
    if isinstance(one, float) and isinstance(other, float):
        same = math.isclose(one, other, rel_tol=DIGITS, abs_tol=1e-9)
        return [] if same else [f"{where}: {one} and {other}"]
    return [] if one == other and type(one) is type(other) else [f"{where}: {one!r}, {other!r}"]


@pytest.mark.parametrize("design", DESIGNS)
def test_verdict_words_and_figures_are_the_same(design):
    (status, one), (other_status, other) = (_certified(design, kernel) for kernel in KERNELS)
    assert status == other_status
    kernels = one["versions"].pop("blas"), other["versions"].pop("blas")
    if "openblas" in kernels[0]:
        assert kernels[0] != kernels[1], "the certificate states what its last bits depend on"
    assert differences(one, other) == []


def test_a_difference_that_shows_would_be_seen():
    """Negative control."""
    answer = {"delay_s": 0.01, "status": "certified", "list": [1.0, {"a": None}]}
    assert differences(answer, answer) == []
    for wrong in (
        {**answer, "delay_s": 0.01 * (1 + 1e-5)},
        {**answer, "status": "not_certified"},
        {**answer, "list": [1.0, {"a": 0.0}]},
        {**answer, "list": [1.0]},
    ):
        assert len(differences(answer, wrong)) == 1
