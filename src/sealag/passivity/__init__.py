"""Passivity criteria: how much delay a design tolerates, and the proof of it.

`solve` answers a `Problem` with a `Bound`, for a multiplier that each `Instant`, a whole `Motion`
or polytopes in `Windows` share. A `Certificate` is question, answer and evidence;
`Certificate.verify` checks it from its own numbers, without the code that made it.
"""

from sealag.passivity._bound import Bound
from sealag.passivity._certificate import Certificate
from sealag.passivity._checks import Verification
from sealag.passivity._kinds import Basis, Criterion, Place, Status
from sealag.passivity._local import LocalLoop
from sealag.passivity._problem import Problem
from sealag.passivity._proofs import InstantProof
from sealag.passivity._solve import Instant, Motion, max_delay, solve
from sealag.passivity._solvers import ClarabelCvxpy, ClarabelDirect, Solution, Solver
from sealag.passivity._stated import Evidence
from sealag.passivity._statement import Answer, Assumption, Critical, Question, Rest, Worst
from sealag.passivity._windows import Windows

__all__ = [
    "Answer",
    "Assumption",
    "Basis",
    "Bound",
    "Certificate",
    "ClarabelCvxpy",
    "ClarabelDirect",
    "Criterion",
    "Critical",
    "Evidence",
    "Instant",
    "InstantProof",
    "LocalLoop",
    "Motion",
    "Place",
    "Problem",
    "Question",
    "Rest",
    "Solution",
    "Solver",
    "Status",
    "Verification",
    "Windows",
    "Worst",
    "max_delay",
    "solve",
]
