"""Mutated projects and robots end in an answer or a sentence, never in a traceback or without end.

`make fuzz` goes on with fresh seeds; SEALAG_FUZZ_SEED and SEALAG_FUZZ_COUNT choose others here.
"""

import os

import pytest

import sealag
from fuzz.run import design, tried

SEED = int(os.environ.get("SEALAG_FUZZ_SEED", 20161115))
COUNT = int(os.environ.get("SEALAG_FUZZ_COUNT", 2000))
CHUNK = 100


@pytest.mark.parametrize("first", range(0, COUNT, CHUNK))
def test_no_mutation_breaks_the_library(first, tmp_path):
    seeds = range(SEED + first, SEED + min(first + CHUNK, COUNT))
    print(f"seeds {seeds}")
    found = [tried(design(seed, tmp_path), seed) for seed in seeds]
    assert [one for one in found if one is not None] == []


@pytest.mark.parametrize(
    ("error", "words"),
    [(ZeroDivisionError("x"), "ZeroDivisionError"), (sealag.errors.InputError(""), "sentence")],
)
def test_a_foreign_exception_is_found(error, words, tmp_path, monkeypatch):
    """The control: a load that breaks."""

    def broken(_path):
        raise error

    monkeypatch.setattr(sealag, "load", broken)
    found = tried(design(SEED, tmp_path), SEED)
    assert found is not None
    assert words in found.said


def test_what_never_ends_is_found(tmp_path, monkeypatch):
    """The control: a load that does not return."""

    def endless(_path):
        while True:
            pass

    monkeypatch.setattr(sealag, "load", endless)
    monkeypatch.setattr("fuzz.run.LIMIT", 1)
    found = tried(design(SEED, tmp_path), SEED)
    assert found is not None
    assert found.said == "longer than 1 s"


def test_mutations_reach_every_stage(tmp_path):
    """A good share of mutated designs is still loaded; else only the parser is tried."""
    loaded = 0
    for seed in range(SEED, SEED + 100):
        try:
            sealag.load(design(seed, tmp_path))
            loaded += 1
        except sealag.errors.SealagError:
            pass
    assert 20 <= loaded <= 90
