"""What keeps a design from being certified, and what keeps a proof from counting."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.certificates import half_a_step
from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system, constant_delays
from helpers.solvers import Forgetful
from sealag.design import certified_bounds, load


@pytest.mark.parametrize(("share", "status"), [(0.99, "certified"), (1.02, "not_certified")])
def test_a_delay_is_certified_up_to_the_bound_and_no_further(tmp_path, share, status):
    system = arm_system(tmp_path)
    bound = sealag.certify(system).answer.max_delay_s
    way = share * bound / 2.0
    answer = sealag.certify(replace(system, delays=constant_delays(way, way))).answer
    assert answer.max_delay_s == pytest.approx(bound, rel=1e-12)
    assert answer.status == status
    assert any("exceeds the bound" in reason for reason in answer.reasons) == (share > 1.0)


def test_an_indefinite_task_stiffness_is_refused(tmp_path):
    system = arm_system(tmp_path)
    spaces = system.spaces()
    lowest = float(np.linalg.eigvalsh(spaces.F_task[0])[0])
    for shift, refused in ((0.9 * lowest, False), (1.1 * lowest, True)):
        moved = replace(spaces, F_task=spaces.F_task - shift * np.eye(system.robot.n))
        bound = certified_bounds(moved, system)
        assert (bound.delay[0] == 0.0) == refused
        assert any("indefinite at 1 of 1" in words for words in bound.refusals) == refused


def test_no_window_reaches_across_a_change_of_contacts():
    system = load("bundled:hume")
    motion = half_a_step(system)
    index = np.repeat([0, 1], [17, 23])
    sets = (system.contacts, system.contacts[:1])
    changing = replace(motion, contact_sets=sets, contact_index=index)
    windows = sealag.certify(system, changing, time_varying=True).evidence.time_varying_windows
    assert {one.first for one in windows} >= {0, 17}
    assert all((one.first < 17) == (one.last < 17) for one in windows)
    assert sorted(k for one in windows for k in range(one.first, one.last)) == [
        k for k in range(39) if k != 16
    ]


class Counting(Forgetful):
    """Answers all, and counts."""

    name = "a counter"

    def __init__(self):
        super().__init__(10**6)

    @property
    def calls(self):
        return 10**6 - self.answers


def test_a_bound_without_a_proof_is_withdrawn():
    """The solver closes the bracket of (31) and forgets when it is asked for the multiplier."""
    system = load(str(EXAMPLES / "anymal_crawl.toml"))
    counting = Counting()
    proven = sealag.certify(system, criterion="published", solver=counting)
    assert proven.answer.max_delay_s > 0.0
    assert len(proven.evidence.proofs) == 1
    forgot = sealag.certify(system, criterion="published", solver=Forgetful(counting.calls - 1))
    assert forgot.answer.status == "not_certified"
    assert forgot.answer.max_delay_s == 0.0
    assert not forgot.evidence.proofs
    assert "1 of 1 bounds have no proof, instant 0" in forgot.answer.reasons[0]
    assert "a forgetful solver says forgot" in forgot.answer.reasons[0]
