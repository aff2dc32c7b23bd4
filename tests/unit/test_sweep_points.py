"""Points of a sweep: the same list whenever it is asked for, with the values that were given."""

import itertools
import math

import numpy as np
import pytest
from scipy.stats import qmc

from helpers.two_joints import two_joints
from sealag.errors import InputError
from sealag.sweep import Sweep

HAND = "tasks.hand.stiffness"
DELAY = "delays.central_round_trip.value_ms"


@pytest.fixture
def points(tmp_path):
    """All points of a sweep, asked for a few at a time."""
    project = two_joints(tmp_path)

    def of(*over, sample="grid", size=3):
        found = Sweep.of(project, over, sample=sample).sample
        firsts = range(0, found.points, size)
        blocks = [found.block(k, min(k + size, found.points)) for k in firsts]
        return list(itertools.chain(*blocks))

    return of


def test_a_grid_is_every_combination_with_the_last_key_first(points):
    found = points(f"{HAND}=10:40:lin4", f"{DELAY}=1,2.5,4")
    assert found == list(itertools.product([10.0, 20.0, 30.0, 40.0], [1.0, 2.5, 4.0]))


def test_a_logarithmic_grid_has_equal_ratios_and_its_own_ends(points):
    values = [value for (value,) in points(f"{HAND}=10:400:log7")]
    assert (values[0], values[-1]) == (10.0, 400.0)
    assert np.diff(np.log(values)) == pytest.approx(math.log(40.0) / 6.0)


def test_whole_numbers_and_words_stay_what_they_are(points):
    found = points("simulation.seed=3:5:int", "controller.gravity=planned,feedback")
    assert found == list(itertools.product([3, 4, 5], ["planned", "feedback"]))
    assert all(type(seed) is int for seed, _ in found)


def test_samples_are_scipy_s_in_whatever_blocks(points):
    over = (f"{HAND}=10:400:log", f"{DELAY}=1:5")
    for kind, engine in (("sobol", qmc.Sobol), ("lhs", qmc.LatinHypercube)):
        shares = engine(2, seed=np.random.default_rng(5)).random(16)
        whole = np.column_stack([10.0 * 40.0 ** shares[:, 0], 1.0 + 4.0 * shares[:, 1]])
        for size in (1, 3, 16):
            found = np.array(points(*over, sample=f"{kind}:16:5", size=size))
            assert found == pytest.approx(whole, rel=1e-12)
        assert points(*over, sample=f"{kind}:16:6") != points(*over, sample=f"{kind}:16:5")


def test_samples_choose_among_words_and_whole_numbers(points):
    found = points("simulation.seed=0:9:int", f"{DELAY}=1,2", sample="lhs:100")
    assert {seed for seed, _ in found} == set(range(10))
    assert [sum(delay == one for _, delay in found) for one in (1, 2)] == [50, 50]


@pytest.mark.parametrize(
    ("over", "sample", "said"),
    [
        ([HAND], "grid", "KEY=1,2,5"),
        ([f"{HAND}="], "grid", "KEY=1,2,5"),
        (["stiffness=1,2"], "grid", "no key of a project file"),
        (["tasks..stiffness=1,2"], "grid", "no key of a project file"),
        (["tasks.1.stiffness=1,2"], "grid", "the list has 1 entries, numbered from 0"),
        (["tasks.hnd.stiffness=1,2"], "grid", "did you mean hand?"),
        ([f"{HAND}.3.x=1,2"], "grid", "is a value, not a table"),
        (["tasks.hand.stifness=1,2"], "grid", "takes none of its values"),
        ([f"{HAND}=-2,-1"], "grid", "takes none of its values"),
        ([f"{HAND}=1,1"], "grid", "listed twice"),
        ([f"{HAND}=1,soft"], "grid", "mixed"),
        ([f"{HAND}=1,nan"], "grid", "no value"),
        ([f"{HAND}=1,,2"], "grid", "no value"),
        ([f"{HAND}=1,[2]"], "grid", "no value"),
        ([f"{HAND}=1:2"], "grid", "how many values a grid takes"),
        ([f"{HAND}=2:1:lin3"], "grid", "to a larger one"),
        ([f"{HAND}=0:1:log3"], "grid", "begins above 0"),
        ([f"{HAND}=0:1.5:int"], "grid", "whole ends"),
        ([f"{HAND}=1:2:lin0"], "grid", "LOW:HIGH"),
        ([f"{HAND}=1:2:lin3:4"], "grid", "LOW:HIGH"),
        ([f"{HAND}=1:2:cubic3"], "grid", "LOW:HIGH"),
        ([f"{HAND}=1:2:lin9000000"], "grid", "values at most"),
        ([f"{HAND}=1:2:lin9999", f"{DELAY}=1:2:lin9999"], "grid", "points; 10000000"),
        ([f"{HAND}=1,2", "tasks.0.stiffness=3,4"], "grid", "are of one value"),
        ([f"{DELAY}=1,2", "delays.central_round_trip=3,4"], "grid", "are of one value"),
        ([f"{HAND}=1,2"], "grid:4", "as many points as its values make"),
        ([f"{HAND}=1:2"], "lhs", "lhs:POINTS"),
        ([f"{HAND}=1:2"], "lhs:0", "lhs:POINTS"),
        ([f"{HAND}=1:2"], "lhs:4:-1", "lhs:POINTS"),
        ([f"{HAND}=1:2"], "lhs:100001", "at most"),
        ([f"{HAND}=1:2"], "random:4", "grid, lhs or sobol"),
        ([f"{HAND}=1:2:lin4"], "sobol:4", "leave the number out"),
        ([], "grid", "Nothing is swept"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path, over, sample, said):
    with pytest.raises(InputError, match=said.replace("?", r"\?")):
        Sweep.of(two_joints(tmp_path), over, sample=sample)
