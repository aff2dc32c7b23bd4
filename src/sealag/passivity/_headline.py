"""What may be done with a design, in one sentence."""

from collections.abc import Mapping

from sealag.passivity._kinds import Status
from sealag.passivity._statement import Answer, Question
from sealag.units import LONGEST_DELAY_S, bound_text, in_ms

_ALIKE = 0.9
"""Share of the largest from which a joint limits as much. Ten percent are what gains are tuned to;
closer to 1 rounding would choose among equal legs."""

_NAMED = 3
"""Joints that a sentence names."""


def headline(question: Question, answer: Answer) -> str:
    """Return the sentence; times that are tolerated are rounded down.

    Args:
        question: of a certificate.
        answer: of the same.
    """
    delay, bound, margin = question.delay_s, answer.max_delay_s, answer.local_margin_s
    yours = f"your delay is {in_ms(delay)}"
    if answer.status is Status.PASSIVE_ONLY:
        return (
            f"passive up to {bound_text(bound)}; {yours}; but {_stability(answer)}: it falls or "
            "drifts unless you stabilise it by other means (then --allow-unstable)"
        )
    tolerated = min(bound, margin) if answer.stable and margin is not None else bound
    if answer.status is Status.CERTIFIED:
        if tolerated > LONGEST_DELAY_S:
            return (
                f"tolerates {bound_text(tolerated)}: delay is not what limits this design; {yours}"
            )
        limit = _limiting(answer.worst.direction) if tolerated == bound else "stability limits"
        return f"tolerates {bound_text(tolerated)}; {yours}; {limit}; {_stability(answer)}"
    if tolerated == 0.0:
        return f"no delay is shown to be tolerated; {yours}; {_stability(answer)}"
    if delay > tolerated:
        return (
            f"tolerates {bound_text(tolerated)}, too little: {yours}; "
            f"{_limiting(answer.worst.direction)}; {_stability(answer)}"
        )
    return f"not shown to tolerate your delay of {in_ms(delay)}; {_stability(answer)}"


def _stability(answer: Answer) -> str:
    if answer.stable is None:
        return "whether it is stable stays open"
    if answer.stable:
        return f"stable up to {bound_text(answer.local_margin_s or 0.0)}"
    if answer.equilibrium is not None and not answer.equilibrium.found:
        return "nothing holds it in this posture"
    return "it is unstable even without delay"


def _limiting(direction: Mapping[str, float]) -> str:
    """The joints whose motion turns the loop active first."""
    most = max(direction.values())
    order = sorted(direction, key=lambda name: -direction[name])
    names = [name for name in order if direction[name] >= _ALIKE * most]
    if len(names) == 1:
        return f"joint {names[0]} limits"
    if len(names) > _NAMED:
        names = [*names[: _NAMED - 1], f"{len(names) - _NAMED + 1} more"]
    return f"joints {', '.join(names[:-1])} and {names[-1]} limit"
