"""Certificates to verify, and to forge."""

import copy
import functools
import hashlib
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import sealag
from helpers.designs import EXAMPLES
from sealag.design import System
from sealag.errors import CertificateError
from sealag.passivity import Certificate
from sealag.robot import Motion
from sealag.walking import GroundProfile, WalkPlan
from sealag.whole_body import MotorAngles, Tank


def plain(certificate: Any) -> dict[str, Any]:
    """What a certificate says once written and read again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "c.json"
        certificate.write(path)
        return json.loads(path.read_text())


@functools.cache
def _made(name: str) -> dict[str, Any]:
    if name == "moving":
        return plain(_moving())
    if name == "one foot":
        system = sealag.load("bundled:hume")
        return plain(
            sealag.certify(
                replace(
                    system,
                    law=replace(system.law, signal=Tank()),
                    contacts=system.contacts[:1],
                    actuators=replace(
                        system.actuators, spring_stiffness=10.0 * system.actuators.spring_stiffness
                    ),
                )
            )
        )
    if name == "crawl":
        return plain(
            sealag.certify(sealag.load(EXAMPLES / "anymal_crawl.toml"), criterion="published")
        )
    if name == "flying":
        system = sealag.load(EXAMPLES / "anymal.toml")
        law = replace(system.law, signal=MotorAngles())
        return plain(sealag.certify(replace(system, law=law, contacts=())))
    if name == "hume held":
        return plain(sealag.certify(sealag.load(EXAMPLES / "hume_held.toml")))
    if name == "late feedback":
        system = sealag.load(EXAMPLES / "hume_held.toml")
        late = replace(system, delays=replace(system.delays, delayed_torque_feedback=True))
        return plain(sealag.certify(late))
    return plain(sealag.certify(sealag.load(EXAMPLES / "baxter.toml")))


def made(name: str) -> dict[str, Any]:
    """A fresh copy: baxter (one instant), moving (half a step of Hume, with multipliers for all of
    it), crawl (two priority levels, published), one foot (Hume, free to turn about it), flying
    (ANYmal without contacts, free to move anywhere), hume held (stable, in the air), late feedback
    (the same, its torque feedback late by the embedded delay)."""
    return copy.deepcopy(_made(name))


def half_a_step(system: System) -> Motion:
    """Forty instants of Hume's walk."""
    whole = WalkPlan.over(GroundProfile.paper(), steps=2).motion(system.robot, rate=100.0)
    return whole.at(slice(0, 40))


def _moving() -> Any:
    system = sealag.load("bundled:hume")
    return sealag.certify(system, half_a_step(system), time_varying=True)


def without_loop(data: dict[str, Any]) -> dict[str, Any]:
    """The same without any claim about the frozen loop, the margins or stability."""
    nothing = (
        "local_loop",
        "jitter_margin_s",
        "local_margin_s",
        "first_crossing_s",
        "stable",
        "conservatism",
    )
    count = data["instants"]
    open_ = {"instant_margins_s": [None] * count, "instant_basis": ["open"] * count}
    less = {**data, **dict.fromkeys(nothing), **open_, "unstable_modes": 0}
    if data["status"] == "certified":
        less |= {"status": "passive_only", "reasons": ["nothing is said of its stability"]}
    return less


def resealed(data: dict[str, Any]) -> dict[str, Any]:
    """The same with a digest that agrees, as a forger would write it: SHA-256 of the canonical JSON
    without the digest itself."""
    hashes = {key: value for key, value in data["hashes"].items() if key != "content"}
    text = json.dumps({**data, "hashes": hashes}, sort_keys=True, separators=(",", ":"))
    return {**data, "hashes": {**hashes, "content": hashlib.sha256(text.encode()).hexdigest()}}


def failures(data: dict[str, Any], *, exact: bool = False) -> list[str]:
    """Names of the checks that fail although the digest agrees."""
    try:
        return [
            check.name
            for check in Certificate.verify(resealed(data), exact=exact).checks
            if not check.ok
        ]
    except CertificateError as error:
        return [f"unreadable: {error}"]
