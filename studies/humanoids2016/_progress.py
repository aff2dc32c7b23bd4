"""How much of the study is left, and what it waits for."""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

MOST_NAMED = 3
PRIOR = 20.0
"""s for which an idle machine's pace counts, so that one slow stage does not tell the whole."""
BUSY = 0.5
"""Load beyond the processors from which the study waits for others."""


class Progress:
    """Says before each stage how long the rest takes, from what the stages so far took.

    Attributes:
        stages: what is computed, and its share of the whole.
    """

    def __init__(
        self,
        stages: Mapping[str, float],
        tell: Callable[[str], None],
        *,
        clock: Callable[[], float] = time.monotonic,
        others: Callable[[], str] | None = None,
    ) -> None:
        """Begin.

        Args:
            stages: seconds of an idle machine by stage, in order.
            tell: called with a sentence before each stage.
            clock: seconds.
            others: names what else keeps the processors busy; empty for nothing.
        """
        self.stages, self._tell, self._clock = stages, tell, clock
        self._others = others or waits_for
        self._start = clock()

    def begin(self, stage: str) -> None:
        """Say that a stage begins.

        Args:
            stage: its name; stages come in the order given.
        """
        names, seconds = list(self.stages), list(self.stages.values())
        k = names.index(stage)
        before, rest = sum(seconds[:k]), sum(seconds[k:])
        pace = (self._clock() - self._start + PRIOR) / (before + PRIOR)
        text = f"[{k + 1}/{len(names)}] {stage}; {_duration(rest * pace)} left"
        others = self._others()
        if others:
            text += f"; waits for {others}"
        self._tell(text)


def _duration(seconds: float) -> str:
    if seconds < 50.0:
        return f"about {max(10, 10 * round(seconds / 10.0))} s"
    return f"about {max(1, round(seconds / 60.0))} min"


def waits_for() -> str:
    """Return which other programs want the processors, and how many; empty if all fit.

    The load counts what runs and what waits to run, of this study too.
    """
    if not hasattr(os, "getloadavg"):
        return ""
    load, processors = os.getloadavg()[0], os.cpu_count() or 1
    if load < processors + BUSY:
        return ""
    names = list(dict.fromkeys(_running()))[:MOST_NAMED]
    which = ", ".join(names) if names else "other programs"
    return f"{which} (load {load:.1f} on {processors} processors)"


def _running() -> Iterator[str]:
    """Names of the programs that run now and are no part of this process group; Linux only."""
    own = os.getpgrp()
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = path.read_text()
        except OSError:
            continue
        name = text[text.index("(") + 1 : text.rindex(")")]
        state, _, group = text[text.rindex(")") + 2 :].split()[:3]
        if state == "R" and int(group) != own:
            yield name
