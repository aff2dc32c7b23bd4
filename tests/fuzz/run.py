"""One mutation through load, certify, margin and a short run."""

import faulthandler
import re
import shutil
import signal
import tomllib
import traceback
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

import sealag
from fuzz.mutate import mutated, mutated_urdf
from helpers.toml import to_toml
from sealag.errors import SealagError
from sealag.export import MujocoModel

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT / "tests" / "data" / "cases"
LIMIT = 90
"""s that a stage may take at most: searches for crossings end after half a minute."""

BASES = (
    "s2_torque_bandwidth_one_joint", "s3_second_instant", "s4_tank_passive_base",
    "s5_tank_locally_active", "s6_singular_posture", "s7_static_joint_gravity",
    "s8_delayed_torque_feedback", "unclear_quantile", "mimic/p", "link_eq_joint/p",
)  # fmt: skip
SLOW = ("../../../examples/anymal", "../../../src/sealag/data/hume")
"""Large robots, for long runs."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What went wrong: the seed that shows it, the stage, and how."""

    seed: int
    stage: str
    said: str


class EndlessError(BaseException):
    """A stage took longer than it may."""


@contextmanager
def limited(seconds: int):
    """Stop what takes longer; end the process where even that does not help."""

    def stop(*_):
        raise EndlessError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    faulthandler.dump_traceback_later(2 * seconds + 30, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def design(seed: int, folder: Path, *, slow: bool = False) -> Path:
    """Write the design of a seed: a project or its robot, mutated."""
    random = Random(seed)
    source = CASES / f"{random.choice(BASES + SLOW if slow else BASES)}.toml"
    for file in source.parent.iterdir():
        if file.is_file() and file.suffix != ".toml" and not (folder / file.name).exists():
            shutil.copy(file, folder)
    project = tomllib.loads(source.read_text())
    urdf = project["robot"]["urdf"]
    own = ":" not in urdf
    text = (source.parent / urdf).read_text() if own else ""
    if own and random.random() < 0.3:
        project["robot"]["urdf"] = f"mutated_{seed}.urdf"
        (folder / f"mutated_{seed}.urdf").write_text(mutated_urdf(text, random), "utf-8", "replace")
    else:
        names = re.findall(r'name="([^"]+)"', text)
        project = mutated(project, random, names)
    path = folder / f"design_{seed}.toml"
    path.write_text(to_toml(project), "utf-8", "surrogatepass")
    return path


def _stages(path: Path):
    """Name and call of every stage, in order; none follows a load that is refused."""
    system = None

    def load():
        nonlocal system
        system = sealag.load(path)

    yield "load", load
    if system is not None:
        yield "certify", lambda: sealag.certify(system)
        yield "margin", lambda: system.local_margins()
        yield "simulate", lambda: sealag.simulate(system, duration=0.05)
        yield "export", lambda: MujocoModel.of(system)


def tried(path: Path, seed: int) -> Finding | None:
    """Take a design through every stage; what it must not do is a finding."""
    for stage, call in _stages(path):
        try:
            with limited(LIMIT):
                call()
        except SealagError as error:
            if not str(error).strip():
                return Finding(seed, stage, f"{type(error).__name__} without a sentence")
        except EndlessError:
            return Finding(seed, stage, f"longer than {LIMIT} s")
        except Exception as error:
            frames = traceback.extract_tb(error.__traceback__)
            ours = [one for one in frames if "sealag" in one.filename]
            at = (ours or frames)[-1]
            where = f"{Path(at.filename).name}:{at.lineno}"
            return Finding(seed, stage, f"{type(error).__name__} at {where}: {str(error)[:200]}")
    return None
