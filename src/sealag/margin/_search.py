"""All turns or frequencies at which a delay can put a root on the imaginary axis.

Intervals are taken from the list, the eigenvalues computed at their centres, and as much about the
centre taken away as the family decides: nothing on the axis there, or eigenvalues that each meet it
at most once. What is too narrow to split is left as a band.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from sealag.errors import SolverError
from sealag.margin._family import Curve, Family
from sealag.margin._pictures import Picture

_SHRINK = 1.5
_LEAST = 0.12
MOST_SAMPLES = 10_000
"""Samples at most. Robots need up to a few hundred; ten times fewer leave dense loops with hundreds
of crossings open; ten times more take minutes for loops that never close."""


class Piece(NamedTuple):
    """An interval of the parameter; `end` where it is an end of the domain with its mirror image.

    Attributes:
        lower: lower end.
        upper: upper end.
        end: the symmetric end that is its centre, or NaN.
    """

    lower: float
    upper: float
    end: float

    @property
    def half(self) -> float:
        """How far it reaches from its centre."""
        return self.upper - self.lower if self.end == self.end else (self.upper - self.lower) / 2.0

    @property
    def centre(self) -> float:
        """The symmetric end, or the middle."""
        return self.end if self.end == self.end else (self.lower + self.upper) / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """A part of the parameter's range in which some eigenvalues each meet the axis at most once.

    Attributes:
        family: the eigenvalues at the centre.
        curves: which of them.
        lower: lower end of the part.
        upper: upper end.
    """

    family: Family
    curves: tuple[Curve, ...]
    lower: float
    upper: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A band too narrow to split that may hold a crossing.

    Attributes:
        lower: lower end.
        upper: upper end.
        end: whether it touches a symmetric end: a contact at zero frequency or at zero delay.
    """

    lower: float
    upper: float
    end: bool


def search(picture: Picture, *, most: int = MOST_SAMPLES) -> tuple[list[Passage], list[Band]]:
    """Exclude everything but passages and narrow bands.

    Args:
        picture: the parameter and its families.
        most: samples at most.

    Returns:
        The passages, and the bands joined and in order.

    Raises:
        SolverError: more samples than that are needed.
    """
    edges = picture.edges
    todo = [_piece(picture, one, other) for one, other in pairwise(edges)]
    passages: list[Passage] = []
    bands: list[Band] = []
    samples = 0
    while todo:
        piece = todo.pop()
        samples += 1
        if samples > most:
            raise SolverError(
                "The search for crossings does not close: the loop is too close to losing "
                "stability over a whole band of frequencies, or its matrices are badly scaled."
            )
        family = picture.family(piece.centre)
        taken, curves = _decide(picture, piece, family)
        lower, upper = piece.lower, piece.upper
        if taken < piece.half:
            lower, upper = max(lower, piece.centre - taken), min(upper, piece.centre + taken)
        if family is not None and curves:
            passages.append(Passage(family=family, curves=curves, lower=lower, upper=upper))
        narrow = piece.upper - piece.lower <= picture.width(piece.centre)
        blurred = family is not None and family.blurred(piece.half)
        if not taken and (narrow or blurred):
            end = any(picture.symmetric(t) for t in (piece.lower, piece.upper))
            bands.append(Band(lower=piece.lower, upper=piece.upper, end=end))
        elif not taken:
            resting = family is not None and family.rests
            todo += _halves(piece if resting else piece._replace(end=math.nan))
        else:
            rest = [(piece.lower, lower), (upper, piece.upper)]
            todo += [Piece(a, b, math.nan) for a, b in rest if b > a]
    return passages, _joined(bands)


def _decide(
    picture: Picture, piece: Piece, family: Family | None
) -> tuple[float, tuple[Curve, ...]]:
    """How far from the centre the family decides, 0 for nowhere, and the curves that are left."""
    h = piece.half
    while family is not None and h >= _LEAST * piece.half:
        window = picture.window(piece.centre - h, piece.centre + h)
        if family.excluded(h, window):
            return h, ()
        curves = family.curves(h, window)
        if curves is not None:
            return h, tuple(curves)
        h /= _SHRINK
    return 0.0, ()


def _piece(picture: Picture, lower: float, upper: float) -> Piece:
    ends = [end for end in (lower, upper) if picture.symmetric(end)]
    return Piece(lower, upper, ends[0] if ends else math.nan)


def _halves(piece: Piece) -> list[Piece]:
    """Cut in the middle; about a symmetric end leave an eighth to it, for crossings near rest."""
    if piece.end == piece.lower:
        cut = piece.lower + piece.half / 8.0
        return [Piece(piece.lower, cut, piece.end), Piece(cut, piece.upper, math.nan)]
    if piece.end == piece.upper:
        cut = piece.upper - piece.half / 8.0
        return [Piece(piece.lower, cut, math.nan), Piece(cut, piece.upper, piece.end)]
    return [
        Piece(piece.lower, piece.centre, math.nan),
        Piece(piece.centre, piece.upper, math.nan),
    ]


def _joined(bands: list[Band]) -> list[Band]:
    joined: list[Band] = []
    for band in sorted(bands, key=lambda one: one.lower):
        if joined and band.lower <= joined[-1].upper * (1.0 + 1e-15):
            last = joined.pop()
            upper = max(last.upper, band.upper)
            band = Band(lower=last.lower, upper=upper, end=last.end or band.end)
        joined.append(band)
    return joined
