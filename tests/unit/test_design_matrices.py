"""controller.kind = "matrices": one value that ticks, is frozen, and is sampled."""

import tomllib

import numpy as np
import pytest
from scipy.signal import cont2discrete

import sealag
from helpers.designs import EXAMPLES
from helpers.toml import to_toml
from sealag.errors import InputError, SealagError
from sealag.whole_body import Measurement

CUT = 500.0
I, O = np.eye(7), np.zeros((7, 7))
ARM = tomllib.loads((EXAMPLES / "panda.toml").read_text())
KP, KD = (np.diag(list(ARM["controller"][key].values())) for key in ("kp", "kd"))
FILTERED = {"A": -CUT * I, "B": np.hstack([O, CUT * I]), "C": -KD, "D": np.hstack([-KP, O])}
"""Joint PD whose rates are filtered at 500 1/s."""
STATIC = {"D": np.hstack([-KP, -KD])}


def text(value):
    return value.tolist() if isinstance(value, np.ndarray) else value


def project(folder, matrices, **keys):
    """The Panda under matrices."""
    controller = {"kind": "matrices", **{k: text(v) for k, v in {**matrices, **keys}.items()}}
    path = folder / "arm.toml"
    path.write_text(to_toml({**ARM, "controller": controller}))
    return path


def arm(folder, matrices, **keys):
    return sealag.load(project(folder, matrices, **keys))


def discrete(period=1e-3):
    """The same with its measurement held, for a period."""
    system = tuple(FILTERED[name] for name in "ABCD")
    return dict(zip("ABCD", cont2discrete(system, period)[:4], strict=True))


@pytest.mark.parametrize("feedback", ["motor", "joint"])
def test_joint_pd_as_matrices_has_the_numbers_of_joint_pd(tmp_path, feedback):
    path = tmp_path / "pd.toml"
    path.write_text(to_toml({**ARM, "controller": {**ARM["controller"], "feedback": feedback}}))
    law = sealag.load(path)
    loop = law.frozen(rest=law.in_posture())
    mine = arm(tmp_path, STATIC, feedback=feedback)
    found = mine.local_margins()
    assert found.delay_s == pytest.approx(loop.margin().delay, rel=1e-9)
    assert found.jitter_s == pytest.approx(loop.jitter_margin().delay, rel=1e-6)
    assert found.channels_s == pytest.approx(loop.channels(), rel=1e-9)
    assert found.passive_s == 0.0
    assert "matrices" in found.not_passive
    margin = loop.sampled_margin(1e-3)
    assert mine.frozen().sampled_margin(1e-3).delay == pytest.approx(margin.delay, rel=1e-9)


def test_what_ticks_is_what_is_frozen(tmp_path):
    """The ticks of the same controller, that states nothing, are realised to the same loop."""
    system = arm(tmp_path, discrete(), time="discrete")
    own = system.controller()

    class Silent:
        reset, tick = own.reset, own.tick

    found = sealag.freeze(
        Silent(), system.robot, system.actuators, q=system.posture, theta=own.theta
    )
    stated = system.frozen()
    assert (found.loop.memory, stated.memory) == (7, 7)
    assert found.unexplained < 1e-6
    assert found.loop.margin().delay == pytest.approx(stated.margin().delay, rel=1e-6)
    for delay in (0.0, 0.4e-3, 1.7e-3):
        radius = stated.sampled_radius(1e-3, delay)
        assert found.loop.sampled_radius(1e-3, delay) == pytest.approx(radius, rel=1e-7)


def test_continuous_matrices_tick_as_their_exact_discretisation(tmp_path):
    fine = arm(tmp_path, FILTERED)
    continuous = fine.frozen()
    given = arm(tmp_path, discrete(), time="discrete").frozen()
    for delay in (0.0, 0.4e-3, 1.7e-3):
        radius = given.sampled_radius(1e-3, delay)
        assert continuous.sampled_radius(1e-3, delay) == pytest.approx(radius, rel=1e-9)
    margin = continuous.margin().delay
    short = continuous.sampled_margin(1e-4)
    assert 0.0 < short.proven <= short.delay
    assert margin - 1e-4 < short.delay < margin - 0.4e-4  # both holds
    step = fine.controller()
    seen = Measurement.allocate(nq=7, nv=7, n=7)
    seen.theta[:], seen.theta_dot[:] = step.theta, 1.0
    out = np.zeros(7)
    for k in [*range(5), *range(5)]:
        if k == 0:  # also in the middle: the past is forgotten
            step.reset(0.0, seen)
        step.tick(1e-3 * k, seen, out)
        expected = -np.diag(KD) * (1.0 - np.exp(-CUT * 1e-3 * k))
        np.testing.assert_allclose(out - step.offset, expected, atol=1e-9)


def test_each_way_has_a_jitter_margin(tmp_path):
    loop = arm(tmp_path, FILTERED).frozen()
    margin, ways = loop.margin().delay, loop.jitter_ways()
    assert 0.7 * margin < ways["measurement"] <= margin
    assert 0.7 * margin < ways["command"] <= margin
    late = loop.late_measurement(np.ones(len(loop.states), dtype=bool), weight=0.1)
    assert late.margin().delay == pytest.approx(margin, rel=1e-9)


def test_it_integrates(tmp_path):
    """A weak integrator takes no margin, a strong one all of it."""
    weak = {"A": O, "B": np.hstack([I, O]), "C": -0.5 * KP, "D": np.hstack([-KP, -KD])}
    found, without = arm(tmp_path, weak).local_margins(), arm(tmp_path, STATIC).local_margins()
    assert found.unstable_modes == 0
    assert found.delay_s == pytest.approx(without.delay_s, rel=1e-4)
    strong = arm(tmp_path, {**weak, "C": -1e3 * KP}).local_margins()
    assert strong.unstable_modes > 0
    assert strong.delay_s == strong.jitter_s == 0.0


def test_it_is_read_from_a_file_and_names_its_joints(tmp_path):
    turn = [4, 2, 0, 6, 1, 3, 5]
    names = [f"panda_joint{i + 1}" for i in turn]
    both = turn + [7 + i for i in turn]
    np.savez(
        tmp_path / "c.npz", A=FILTERED["A"], B=FILTERED["B"][:, both], C=FILTERED["C"][turn],
        D=FILTERED["D"][np.ix_(turn, both)],
    )  # fmt: skip
    system = arm(tmp_path, {}, file="c.npz", inputs=names, outputs=names)
    assert tmp_path / "c.npz" in system.files
    np.testing.assert_array_equal(system.frozen().C, arm(tmp_path, FILTERED).frozen().C)


def test_it_runs_in_the_simulator_and_is_swept(tmp_path):
    system = arm(tmp_path, FILTERED)
    run = sealag.simulate(system, scenario="regulate", duration=0.05)
    np.testing.assert_allclose(run.v, 0.0, atol=1e-6)
    assert system.rate_sweep([200.0])[0].stable is False
    own = arm(tmp_path, discrete(), time="discrete").rate_sweep()
    assert [one.rate_hz for one in own] == [1000.0]
    with pytest.raises(InputError, match="other rates"):
        arm(tmp_path, discrete(), time="discrete").rate_sweep([500.0])


def test_no_certificate_covers_it(tmp_path):
    with pytest.raises(InputError, match="given as matrices, which state no potential"):
        sealag.certify(arm(tmp_path, STATIC))


@pytest.mark.parametrize(
    ("matrices", "words"),
    [
        ({}, "matrices A, B, C are missing"),
        ({"A": [[1.0]]}, "matrices B, C are missing"),
        ({"D": [[1.0, 2.0]]}, r"D is \(1, 2\); \(7, 14\) is right for 0 states"),
        ({**FILTERED, "B": I}, r"B is \(7, 7\); \(7, 14\) is right"),
        ({"D": [[1.0, 2.0], [3.0]]}, "D has rows of different lengths"),
        ({"D": [[]]}, "D is empty"),
        ({**STATIC, "A": [], "B": [], "C": [[]] * 7}, "A is empty"),
        ({"D": [[float("nan")]]}, "controller.D"),
        ({**STATIC, "file": "c.npz"}, "one of both"),
        ({"file": "none.npz"}, "none.npz"),
        ({"file": "arm.toml"}, "no NPZ file"),
        ({**STATIC, "inputs": ["elbow"]}, "elbow"),
        ({**STATIC, "outputs": ["panda_joint1"] * 2}, "twice"),
        ({**STATIC, "outputs": ["panda_joint1"]}, r"\(1, 14\) is right"),
        ({**STATIC, "gravity": "planned"}, "controller.gravity is not known"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, matrices, words):
    with pytest.raises(SealagError, match=words) as refused:
        arm(tmp_path, matrices)
    assert str(refused.value).count("\n") == 0


def test_a_discrete_one_needs_its_period(tmp_path):
    path = project(tmp_path, STATIC, time="discrete")
    path.write_text(path.read_text().replace('"sample_time_ms" = 1.0', '"sample_time_ms" = 0.0'))
    with pytest.raises(SealagError, match="sample_time_ms"):
        sealag.load(path)


def test_an_answer_that_alternates_has_no_margin(tmp_path):
    """x_{k+1} = −x_k has no bilinear equivalent."""
    with pytest.raises(InputError, match="eigenvalue at -1"):
        arm(tmp_path, {**FILTERED, "A": -I}, time="discrete").local_margins()
