"""What `certify` writes, `verify` accepts: equal slow joints, lower claims, and what stays open."""

import math
from dataclasses import replace

import pytest

import sealag
from helpers.certificates import failures, plain
from helpers.designs import EXAMPLES
from helpers.wheels import four_wheels
from sealag.errors import SolverError
from sealag.margin import DelayedLoop
from sealag.passivity import Certificate, Status
from sealag.second_verifier import claims

NO_EARLIER = "no root crosses before"


def baxter():
    return sealag.certify(sealag.load(EXAMPLES / "baxter.toml"))


def second_refuses(data):
    return [name for name, holds, _ in claims(data) if holds is False]


def later(certificate, factor):
    """The same with a margin and crossing that lie later, and everything that follows from it."""
    answer, evidence = certificate.answer, certificate.evidence
    margin = factor * answer.local_margin_s
    return replace(
        certificate,
        answer=replace(
            answer,
            local_margin_s=margin,
            first_crossing_s=margin,
            conservatism=margin / answer.max_delay_s,
        ),
        evidence=replace(evidence, instant_margins_s=(margin,)),
    )


@pytest.mark.parametrize("stiffness", [1e-4, 1e-2, 5.0])
def test_four_equal_slow_joints(stiffness, tmp_path):
    """D θ̇ = −F θ(t − d) crosses at ω = F/D after a quarter of a turn: d = π D / 2F."""
    certificate = sealag.certify(four_wheels(tmp_path, stiffness=stiffness, damping=20.0))
    data = plain(certificate.confirmed())
    assert data["status"] == "certified"
    assert failures(data) == second_refuses(data) == []
    if stiffness < 1.0:  # slow beside springs and motors
        crossing = math.pi * 20.0 / (2.0 * stiffness)
        assert data["local_margin_s"] == pytest.approx(crossing, rel=1e-3)
    loop = certificate.evidence.local_loop
    known = DelayedLoop(loop.A_0, loop.A_1).roots(0.99 * data["local_margin_s"], count=4)
    assert (known.real < 0.0).all()


@pytest.mark.parametrize("factor", [0.999, 1.01, 2.0])
def test_another_margin_of_four_equal_joints_is_refused(factor, tmp_path):
    """The control: at an earlier delay no root is on the axis, before a later one roots cross."""
    certificate = sealag.certify(four_wheels(tmp_path, stiffness=1e-4, damping=20.0))
    wrong = later(certificate, factor)
    found = [check.name for check in wrong.checks() if not check.ok]
    assert "root on the axis at the first crossing" in found
    assert (NO_EARLIER in found) is (factor > 1.0)


def test_equal_joints_with_an_embedded_part_are_counted_one_by_one(tmp_path):
    """Roots are counted where torque feedback is late too: k equal joints, k times the roots."""
    certificate = sealag.certify(four_wheels(tmp_path, stiffness=1e-4, damping=20.0))
    loop = certificate.evidence.local_loop
    counted = replace(
        certificate,
        evidence=replace(
            certificate.evidence,
            local_loop=replace(loop, A_e=0.0 * loop.A_0, embedded_delay_s=1e-3),
        ),
    )
    checks = {check.name: check for check in counted.checks()}
    assert checks[NO_EARLIER].ok, checks[NO_EARLIER].detail
    assert checks[NO_EARLIER].detail.startswith("0, 0, 0, 0 roots")
    after = {check.name: check for check in later(counted, 1.01).checks()}[NO_EARLIER]
    assert not after.ok
    assert ", 8 roots" in after.detail  # 0.999 of it: each joint has lost its pair


def test_a_margin_that_rounding_hides_is_open_and_not_infinite(tmp_path):
    """F of 5e-8 Nm/rad crosses after 20 years; beside springs of 300 Nm/rad doubles lose it."""
    system = four_wheels(tmp_path, stiffness=5e-8, damping=20.0, inertia=1e-6)
    data = plain(sealag.certify(system).confirmed())
    assert data["local_margin_s"] != "unbounded"
    assert failures(data) == second_refuses(data) == []
    if data["local_margin_s"] is None:
        assert data["status"] == "passive_only"
        assert "left open" in data["reasons"][-1]


def test_what_is_confirmed_is_the_same():
    certificate = baxter()
    assert certificate.confirmed() is certificate


def test_a_margin_that_is_not_confirmed_is_withdrawn():
    """The lower claim holds for both verifiers; the control does for none."""
    certificate = later(baxter(), 1.01)
    assert failures(plain(certificate)) != []
    lower = certificate.confirmed()
    data = plain(lower)
    assert (data["status"], data["stable"], data["local_margin_s"]) == ("passive_only", None, None)
    assert NO_EARLIER in data["reasons"][-1] or "root on the axis" in data["reasons"][-1]
    assert failures(data) == second_refuses(data) == []
    assert "stays open" in lower.headline


def test_a_bound_that_is_not_confirmed_is_not_claimed():
    certificate = baxter()
    (proof,) = certificate.evidence.proofs
    wrong = replace(certificate.evidence, proofs=(replace(proof, F=2.0 * proof.F),))
    with pytest.raises(SolverError, match=r"does not confirm .*so that nothing is claimed"):
        replace(certificate, evidence=wrong).confirmed()


def test_no_lower_claim_raises_the_status():
    """A design that is refused for its margin is not passive only once that is withdrawn."""
    certificate = sealag.certify(sealag.load(EXAMPLES / "baxter.toml"), criterion="published")
    late = replace(certificate.question, delay_s=0.9999 * certificate.answer.max_delay_s)
    answer = replace(certificate.answer, status=Status.NOT_CERTIFIED, reasons=("its margin",))
    refused = replace(certificate, question=late, answer=answer)
    assert [check.name for check in refused.checks() if not check.ok] == ["hashes"]
    with pytest.raises(SolverError, match="verdict"):
        later(refused, 1.0001).confirmed()


def test_the_file_of_the_readme_s_lines_is_read(tmp_path):
    path = tmp_path / "c.json"
    baxter().confirmed().write(path)
    assert Certificate.verify(path).valid


def test_a_process_with_three_linear_algebras_is_certified():
    """Each names its kernels and threads: 80 characters that are no reason to refuse."""
    made = baxter()
    three = "openblas-SkylakeX-2threads+openblas-SkylakeX-1threads+openblas-Zen-1threads"

    def named(blas):
        versions = {**made.answer.versions, "blas": blas}
        return replace(made, answer=replace(made.answer, versions=versions))

    assert named(three).confirmed().answer.status is made.answer.status
    with pytest.raises(SolverError, match="versions"):
        named("three of them").confirmed()
