"""Designs at the edge of stability: gains scaled until the rightmost root is about on the axis."""

import re
from pathlib import Path

import sealag
from oracle.black_box.box import BlackBox
from oracle.black_box.law import Unsettled
from oracle.black_box.rest import NoEquilibrium
from oracle.black_box.roots import roots, unstable_count

BISECTIONS = 12
BESIDE = 2e-3
"""How far beside the threshold the gains are left, relative."""


def at_threshold(path: Path) -> tuple[Path, Path] | None:
    """Write a design twice, its task gains just below and just above a change of stability.

    Args:
        path: the design; the copies are written beside it.

    Returns:
        Both paths; None if no factor from 1/30 to 30 changes its stability.
    """
    low, high = 1.0, 1.0
    here = _stable(path, 1.0)
    for factor in (3.0, 1 / 3.0, 30.0, 1 / 30.0):
        there = _stable(path, factor)
        if here is not None and there is not None and there != here:
            low, high = 1.0, factor
            break
    else:
        return None
    for _ in range(BISECTIONS):
        middle = (low * high) ** 0.5
        found = _stable(path, middle)
        if found is None:
            return None
        low, high = (middle, high) if found == here else (low, middle)
    edge = (low * high) ** 0.5
    return _scaled(path, edge * (1 - BESIDE), "below"), _scaled(path, edge * (1 + BESIDE), "above")


def _stable(path: Path, factor: float) -> bool | None:
    scaled = _scaled(path, factor, "try")
    try:
        black = BlackBox(scaled, sealag.load(scaled))
        loop = black.loop(black.rest())
    except (NoEquilibrium, Unsettled, sealag.SealagError):
        return None
    return unstable_count(roots(loop.A_0, [*loop.fixed, loop.delayed]))[0] == 0


def _scaled(path: Path, factor: float, name: str) -> Path:
    """Write the design with its task gains times a factor."""

    def times(found: re.Match) -> str:
        numbers = re.sub(r"[0-9.]+(e[-+]?[0-9]+)?", lambda x: repr(float(x[0]) * factor), found[2])
        return found[1] + numbers

    text = re.sub(r"(?m)^(stiffness = )(.*)$", times, path.read_text())
    out = path.with_name(f"{path.stem}_{name}.toml")
    out.write_text(text)
    return out
