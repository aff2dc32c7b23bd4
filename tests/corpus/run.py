"""One robot through init, certify, verify, margin and half a second of simulation.

Only the command line is used, as a user would, in this process. What must not be is a finding: a
traceback, a sentence that is none, or two answers that contradict each other.
"""

import contextlib
import io
import json
import time
import tomllib
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from corpus.fill import filled
from fuzz.run import EndlessError, limited
from sealag.cli import main
from sealag.design import load
from sealag.errors import SealagError
from sealag.robot import Robot, load_robot

DURATION = 0.5
"""s, of the run."""
LIMIT = 600
"""s that a robot may take at most."""
BELOW = 1e-6
"""Share by which a certified bound may exceed the exact margin: rounding of the two methods."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a command said.

    Attributes:
        status: its exit status.
        out: standard output.
        err: standard error.
    """

    status: int
    out: str
    err: str

    @property
    def data(self) -> dict[str, Any]:
        """Its JSON."""
        return json.loads(self.out)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How far a robot came.

    Attributes:
        robot: its file.
        joints: how many joints are actuated, 0 if it was not read.
        verdict: status of the certificate, or the command that refused.
        refusal: the sentence of a refusal; empty if there was none.
        findings: what must not be.
        seconds: of one core, everything together.
    """

    robot: Path
    joints: int
    verdict: str
    refusal: str
    findings: tuple[str, ...]
    seconds: float


class RefusedError(Exception):
    """A command did not answer.

    Attributes:
        command: its name.
        sentence: what it said instead.
    """

    def __init__(self, command: str, sentence: str) -> None:
        super().__init__(sentence)
        self.command, self.sentence = command, sentence


def said(*arguments: object) -> Answer:
    """Run a command of sealag in this process.

    Raises:
        RefusedError: its exit status is 2 or 3.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
            status = 0
        except SystemExit as stop:
            status = int(stop.code or 0)
    if status >= 2:
        raise RefusedError(str(arguments[0]), err.getvalue().strip())
    return Answer(status=status, out=out.getvalue(), err=err.getvalue())


def taken(robot: Path, folder: Path, *, read_only: bool = False) -> Outcome:
    """Take a robot through everything.

    Args:
        robot: its file.
        folder: where project, certificate and recording go; it is empty.
        read_only: stop when the starter file is written and its robot is loaded.
    """
    began = time.process_time()
    way = _Way(robot, folder)
    refusal, findings = "", ()
    try:
        with limited(LIMIT):
            findings = tuple(way.whole(read_only=read_only))
    except RefusedError as error:
        refusal = error.sentence
        way.verdict = "refused" if not way.joints else f"{way.verdict} {error.command} refused"
        findings = tuple(misspoken(refusal))
    except EndlessError:
        findings = (f"longer than {LIMIT} s",)
    except SealagError as error:
        findings = (f"init wrote a file of a robot that is refused: {error}",)
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(frame.filename).name}:{frame.lineno}"
        findings = (f"{type(error).__name__} at {where}: {error}"[:300],)
    return Outcome(
        robot=robot, joints=way.joints, verdict=way.verdict.strip(), refusal=refusal,
        findings=findings, seconds=time.process_time() - began,
    )  # fmt: skip


class _Way:
    """A robot on its way: what is known of it when a command refuses it."""

    def __init__(self, robot: Path, folder: Path) -> None:
        self.robot, self.folder = robot, folder
        self.joints, self.verdict = 0, ""

    def whole(self, *, read_only: bool) -> Iterator[str]:
        """Run the commands; what contradicts itself."""
        project, certificate = self.folder / "project.toml", self.folder / "c.json"
        said("init", self.robot, "--out", project)
        described = self._filled(project)
        self.joints = described.n
        if read_only:
            load(project)
            self.verdict = "read"
            return
        certified = said("certify", project, "--out", certificate, "--json")
        self.verdict = certified.data["status"]
        verified = said("verify", certificate, "--json")
        margin = said("margin", project, "--json")
        run = said("simulate", project, "--json", "--duration", DURATION,
                   "--out", self.folder / "run.mcap")  # fmt: skip
        yield from contradictions(certified, verified, margin, run)

    def _filled(self, project: Path) -> Robot:
        """Replace each FILL; the robot as its starter file describes it."""
        text = project.read_text()
        floating = tomllib.loads(text)["robot"]["base"] == "floating"
        found = load_robot(self.robot, floating_base=floating, skip_unusable=True)
        ends = zip(found.position_lower.tolist(), found.position_upper.tolist(), strict=True)
        project.write_text(filled(text, limits=dict(zip(found.joints, ends, strict=True))))
        return found


def misspoken(sentence: str) -> Iterator[str]:
    """What is wrong with a refusal: it is one line, says who speaks, and is no traceback."""
    if "Traceback" in sentence:
        yield f"traceback: {sentence.splitlines()[-1]}"
    elif sentence.count("\n") or not sentence.startswith("sealag: ") or len(sentence) > 1500:
        yield f"not one sentence: {sentence[:300]!r}"


def contradictions(
    certified: Answer, verified: Answer, margin: Answer, run: Answer
) -> Iterator[str]:
    """Answers of four commands about one design that cannot all be true."""
    certificate, exact = certified.data, margin.data
    status, delay = certificate["status"], certificate["delay_s"]
    yes = status == "certified"
    if (certified.status == 0) != yes:
        yield f"certify says {status} and ends with {certified.status}"
    if not verified.data["valid"] or verified.data["status"] != status:
        yield f"verify says {verified.data['status']} of a certificate that says {status}"
    bound, at = certificate["max_delay_s"], certificate["local_margin_s"]
    if yes and not (delay <= bound and certificate["stable"]):
        yield f"certified at {delay} s with a bound of {bound} s"
    if not _same(bound or 0.0, exact["passive_s"] or 0.0):
        yield f"certify bounds the delay by {bound} s, margin by {exact['passive_s']} s"
    if at is not None and exact["delay_s"] is not None and not _same(at, exact["delay_s"]):
        yield f"certify knows a margin of {at} s, margin one of {exact['delay_s']} s"
    if yes and exact["delay_s"] is not None and bound > exact["delay_s"] * (1.0 + BELOW):
        yield f"certified up to {bound} s, above the exact margin {exact['delay_s']} s"
    if certificate["unstable_modes"] != exact["unstable_modes"] and exact["equilibrium"] != "none":
        yield (
            f"certify counts {certificate['unstable_modes']} unstable roots, margin "
            f"{exact['unstable_modes']}"
        )
    if yes and run.data["outcome"] != "completed":
        yield f"certified, but the run {run.data['outcome']}: {run.data['message']}"
    if (run.status == 0) != (run.data["outcome"] == "completed"):
        yield f"simulate ends with {run.status} and says {run.data['outcome']}"
    if not abs(run.data["energy_residual_j"]) <= 1e-6 * max(run.data["energy_throughput_j"], 1.0):
        yield f"energy is lost: {run.data['energy_residual_j']} J"


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= BELOW * max(abs(one), abs(other))
