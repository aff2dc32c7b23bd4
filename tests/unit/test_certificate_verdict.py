"""certified, passive_only, not_certified: what each needs, and that no forged one holds."""

import json
from dataclasses import replace

import pytest

import sealag
from helpers.certificates import failures, made, plain, resealed
from helpers.designs import EXAMPLES
from sealag.delay import Constant, Delays
from sealag.errors import CertificateError
from sealag.passivity import Certificate
from sealag.second_verifier import claims


def second_refuses(data):
    return [name for name, holds, _ in claims(resealed(data)) if holds is False]


def at_delay(name, share, criterion):
    """An example whose delay is a share of its local margin."""
    system = sealag.load(EXAMPLES / f"{name}.toml")
    margin = sealag.certify(system).answer.local_margin_s
    delays = Delays(central=Constant(share * margin), embedded=Constant(0.0))
    system = replace(system, delays=delays)
    hold = system.delays.d_1 - share * margin
    delays = Delays(central=Constant(share * margin - hold), embedded=Constant(0.0))
    return sealag.certify(replace(system, delays=delays), criterion=criterion)


def test_point_feet_are_passive_only():
    """Hume standing on two points is an inverted pendulum, whatever its delay."""
    system = sealag.load("bundled:hume")
    short = Delays(central=Constant(0.002), embedded=Constant(0.001))
    certificate = sealag.certify(replace(system, delays=short))
    answer = certificate.answer
    assert (answer.status, answer.stable) == ("passive_only", False)
    assert "no stable equilibrium" in answer.reasons[0]
    assert "--allow-unstable" in certificate.headline
    assert failures(plain(certificate)) == []


def test_what_falls_freely_is_passive_only():
    data = made("flying")
    assert data["status"] == "passive_only"
    assert "no equilibrium" in data["reasons"][0]


@pytest.mark.parametrize(("share", "status"), [(0.999, "certified"), (1.001, "not_certified")])
def test_the_margin_decides_where_a_bound_is_too_long(share, status):
    """ANYmal's published bound of 147 ms lies beyond its margin of 87 ms."""
    certificate = at_delay("anymal", share, "published")
    assert certificate.answer.max_delay_s > 1.5 * certificate.question.delay_s
    assert certificate.answer.status == status
    data = plain(certificate)
    assert failures(data) == second_refuses(data) == []
    if status == "not_certified":
        assert "loses its stability" in data["reasons"][0]
        assert certificate.headline.startswith("tolerates 87.4 ms, too little")


def _says(status, *reasons):
    return lambda d: d.update(status=status, reasons=list(reasons))


def _late(d):
    d["delay_s"] = 0.5 * (d["local_margin_s"] + d["max_delay_s"])


FORGED = {
    "certified though nothing holds it": ("flying", _says("certified")),
    "certified though unstable": ("one foot", _says("certified")),
    "certified and stable though unstable": (
        "one foot",
        lambda d: d.update(status="certified", reasons=[], stable=True),
    ),
    "passive only though stable": ("baxter", _says("passive_only", "I say so")),
    "refused though stable": ("baxter", _says("not_certified", "I say so")),
    "refused though passive": ("one foot", _says("not_certified", "I say so")),
    "passive only without a reason": ("one foot", _says("passive_only")),
    "certified with a reason": ("baxter", lambda d: d.update(reasons=["but"])),
    "certified beyond the margin": ("crawl", _late),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_status_holds_for_no_verifier(name):
    design, change = FORGED[name]
    data = made(design)
    assert failures(data) == second_refuses(data) == []
    change(data)
    own, other = "verdict", "status follows"
    if name == "certified and stable though unstable":  # it follows from what is forged itself
        own, other = "stable without delay", "stability"
    assert own in failures(data)
    assert own in failures(data, exact=True)
    assert other in second_refuses(data)


def test_the_designs_of_forgeries_have_the_statuses_that_are_forged():
    found = {name: made(name)["status"] for name in ("baxter", "crawl", "flying", "one foot")}
    assert found == {
        "baxter": "certified",
        "crawl": "certified",
        "flying": "passive_only",
        "one foot": "passive_only",
    }


def test_an_old_layout_is_refused_with_what_to_do():
    data = {**made("baxter"), "schema": "sealag-certificate/4"}
    with pytest.raises(CertificateError, match="certify the project again") as error:
        Certificate.read(json.loads(json.dumps(resealed(data))))
    assert "\n" not in str(error.value)
    with pytest.raises(CertificateError, match="not a certificate of the layout"):
        Certificate.read({**data, "schema": "sealag-certificate/9"})


def test_the_sentence_names_what_limits_and_never_promises_more():
    certificate = sealag.certify(sealag.load(EXAMPLES / "anymal.toml"))
    parts = certificate.headline.split("; ")
    assert parts[0] == "tolerates 80.5 ms"
    assert float(parts[0].split()[1]) <= 1e3 * certificate.answer.max_delay_s
    assert parts[1] == "your delay is 11.5 ms"
    assert parts[2].endswith("and 2 more limit")
    assert parts[3] == "stable up to 87.4 ms"
    shares = {**certificate.answer.worst.direction, "LF_HFE": 1.0}
    alone = replace(certificate.answer, worst=replace(certificate.answer.worst, direction=shares))
    assert "; joint LF_HFE limits; " in replace(certificate, answer=alone).headline
