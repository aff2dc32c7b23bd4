"""The mutants of the catalogue can be applied, and their tests exist."""

import pytest

from helpers.source import ROOT
from mutants.catalogue import MUTANTS, TESTS, Mutant


def _stale(mutants):
    places = [(one, (ROOT / "src" / "sealag" / one.file).read_text()) for one in mutants]
    return [one.falsifies for one, text in places if text.count(one.old) != 1 or one.old == one.new]


def test_every_mutant_changes_one_place():
    assert _stale(MUTANTS) == []
    assert len(MUTANTS) >= 150


def test_a_stale_mutant_is_noticed():
    gone = Mutant("units", "units.py", "no such text", "x", "nothing")
    twice = Mutant("units", "units.py", "def ", "x", "everything")
    assert _stale([gone, twice]) == ["nothing", "everything"]


@pytest.mark.parametrize("room", sorted(TESTS))
def test_the_tests_of_a_room_exist(room):
    assert all((ROOT / path).is_file() for path in TESTS[room].split())
    assert any(one.room == room for one in MUTANTS)
