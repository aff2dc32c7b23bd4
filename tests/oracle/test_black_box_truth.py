"""The black box on designs whose right values were found by others, and its own negative controls.

The smaller margin of two loops counts: in the posture itself, and where the loop rests.
"""

from pathlib import Path

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from oracle.black_box.box import BlackBox
from oracle.black_box.law import Unsettled
from oracle.black_box.rest import NoEquilibrium
from oracle.black_box.roots import Late, first_crossing, roots

CASES = Path(__file__).parent / "black_box" / "cases"


def box(path, *, replace=(), folder=None, **options):
    """The black box for a project file, some of whose text is replaced."""
    if replace:
        text = path.read_text().replace(*replace)
        path = folder / path.name
        path.write_text(text)
    return BlackBox(path, sealag.load(path), **options)


MARGINS = {  # ms in the posture, and where it rests
    EXAMPLES / "anymal.toml": (87.4415, 87.4415),
    EXAMPLES / "anymal_crawl.toml": (73.6393, 73.6393),
    EXAMPLES / "baxter.toml": (107.6918, 107.6918),
    CASES / "dampbest.toml": (52.2858, 52.8221),
    CASES / "mimic.toml": (420.842, 422.301),
    CASES / "unclear_own_equilibrium.toml": (13.93756, 5.127499),
}


@pytest.mark.parametrize("path", MARGINS, ids=lambda path: path.stem)
def test_margins_in_the_posture_and_at_rest(path):
    found = box(path).both()
    assert found.unstable == 0
    margins = [one.margin * 1e3 for one in (found.posture, found.rest)]
    assert margins == pytest.approx(MARGINS[path], rel=2e-6)
    assert found.margin * 1e3 == min(margins)


@pytest.mark.parametrize("path", MARGINS, ids=lambda path: path.stem)
def test_sealag_says_the_smaller_one(path):
    said = sealag.certify(sealag.load(path), proofs=1).answer.local_margin_s
    assert said * 1e3 == pytest.approx(min(MARGINS[path]), rel=2e-6)


UNSTABLE = {
    "s1_link_hessian_anymal": (1, 0.1743),
    "s2_torque_bandwidth_one_joint": (2, 7.2503),
    "s4_tank_passive_base": (4, 0.00098),
    "s5_tank_locally_active": (2, 0.5745),
    "s8_delayed_torque_feedback": (2, 4.8255),
}


@pytest.mark.parametrize("name", UNSTABLE)
def test_unstable_without_delay(name):
    found = box(CASES / f"{name}.toml").answer()
    count, growth = UNSTABLE[name]
    assert found.unstable == count
    assert found.margin == 0.0
    assert found.rightmost == pytest.approx(growth, rel=1e-2)


@pytest.mark.parametrize(("bandwidth", "margin"), [(100, 91.9930), (600, 100.3306)])
def test_torque_bandwidth_of_baxter_without_its_own_damping(bandwidth, margin, tmp_path):
    path, change = CASES / "s2_torque_bandwidth_baxter.toml", f"torque_bandwidth = {bandwidth}.0"
    text = ("torque_bandwidth = 100.0", change)
    found = box(path, replace=text, folder=tmp_path, no_link_damping=True).answer()
    assert found.margin * 1e3 == pytest.approx(margin, abs=1e-4)


def test_torque_limit_is_exceeded_at_rest():
    assert box(CASES / "s2_torque_limit_one_joint.toml").answer().overloaded == ("j",)


def test_law_with_a_corner_has_no_derivative():
    with pytest.raises(Unsettled, match="add up"):
        box(CASES / "s6_singular_posture.toml").answer()


def test_a_robot_that_nothing_holds_has_no_rest():
    path = CASES / "s3_second_instant.toml"
    black = BlackBox(path, sealag.load(path), contacts=())
    with pytest.raises(NoEquilibrium):
        black.rest()
    found = black.both()
    assert not found.stable
    assert found.margin == 0.0


def test_static_joint_state_of_a_gravity_that_is_stiffer_than_springs():
    found = box(CASES / "s7_static_joint_gravity.toml").answer()
    assert found.margin * 1e3 == pytest.approx(378.491, abs=1e-3)


def test_beside_the_singular_posture_the_margin_is_shorter(tmp_path):
    (tmp_path / "planar.urdf").write_text((CASES / "planar.urdf").read_text())
    path, text = CASES / "s6_singular_posture.toml", ("j2=0.0", "j2=0.001")
    found = box(path, replace=text, folder=tmp_path).answer()
    assert found.margin * 1e3 == pytest.approx(53.3139, abs=1e-3)


def test_instants_of_a_motion():
    path = CASES / "s3_second_instant.toml"
    system = sealag.load(path)
    motion = system.load_motion(path.with_suffix(".csv"))
    found = [
        BlackBox(path, system, q=motion.q[k], contacts=motion.contact_sets[c]).both()
        for k, c in enumerate(motion.contact_index)
    ]
    assert found[0].margin == np.inf
    assert found[1].margin == pytest.approx(0.597454, abs=1e-6)
    assert found[1].rest.margin == pytest.approx(0.61498, abs=1e-5)
    said = sealag.certify(system, motion, proofs=1)
    assert said.answer.local_margin_s == pytest.approx(found[1].margin, rel=1e-6)


def test_two_equilibria_of_the_soft_arm():
    black = box(CASES / "unclear_own_equilibrium.toml")
    near = black.rest()
    q = np.array([-0.937, 1.3113, 0.3704, 0.3771, -0.7126, -0.0272])
    theta = np.array([-0.937, 1.1767, 0.4238, 0.3933, -0.7126, -0.0272])
    far = black.rest((q, theta))
    assert np.abs(far.q - near.q).max() > 0.2
    assert black.answer(far).margin * 1e3 == pytest.approx(4.4662, abs=1e-3)


def test_contact_forces_matter():
    assert box(EXAMPLES / "anymal.toml", no_contact_forces=True).answer().margin * 1e3 > 87.6


def test_link_damping_matters():
    found = box(EXAMPLES / "baxter.toml", no_link_damping=True).answer()
    assert found.margin * 1e3 == pytest.approx(101.963, abs=1e-3)


def test_mimic_joint_moves_with_its_leader():
    black = box(CASES / "mimic.toml")
    alone = BlackBox(CASES / "mimic.toml", sealag.load(CASES / "mimic.toml"))
    alone.body.T[1, 0] = 0.0
    q = black.posture
    assert black.body.whole(q) == pytest.approx([0.3, 0.5])
    assert black.body.mass(q)[0, 0] > 1.5 * alone.body.mass(q)[0, 0]


KNOWN = [
    ([[-2, 0], [0, -0.9]], [[-1, 0], [-1, -1]], np.arccos(-0.9) / np.sqrt(0.19)),
    ([[0, 1], [-1, -1]], [[0, 0], [0, -1]], np.pi),
    ([[0, 1], [-1, -1]], [[0, 0], [-1, 0]], np.pi / 2),
    ([[0.0]], [[-1.0]], np.pi / 2),
    ([[-3, -2.5], [1, 0.5]], [[1.5, 2.5], [-0.5, -1.5]], 2.41840),
]


@pytest.mark.parametrize(("A_0", "A_1", "margin"), KNOWN)
def test_margins_of_the_literature(A_0, A_1, margin):
    A_0, A_1 = np.array(A_0, dtype=float), np.array(A_1, dtype=float)
    late = Late(B=np.eye(len(A_0)), C=A_1, delay=0.0)
    assert first_crossing(A_0, [], late)[0] == pytest.approx(margin, rel=1e-5)


def test_delayed_roots_solve_their_equation():
    late = Late(B=np.eye(1), C=np.array([[-1.0]]), delay=1.0)
    found = roots(np.zeros((1, 1)), [late])
    s = found[np.argmax(found.real)]
    assert abs(s + np.exp(-s)) < 1e-12
    assert s.real == pytest.approx(-0.318131505, abs=1e-9)


def test_slope_of_the_law_is_that_of_its_settled_command():
    black = box(EXAMPLES / "anymal.toml")
    rest, law, nv = black.rest(), black.law, black.body.nv
    C = law.slope(rest.q, rest.theta)
    step = 1e-5 * np.random.default_rng(3).normal(size=C.shape[1])

    def there(sign):
        return law.command(black.body.move(rest.q, sign * step[:nv]), rest.theta + sign * step[nv:])

    change = (there(1) - there(-1)) / 2
    assert change == pytest.approx(C @ step, abs=1e-6 * np.abs(change).max())
    assert change != pytest.approx(C[:, nv:] @ step[nv:], abs=1e-3 * np.abs(change).max())
