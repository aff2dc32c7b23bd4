"""Closed sets of words in a certificate."""

from enum import StrEnum


class Status(StrEnum):
    """The answer to the question that was asked."""

    CERTIFIED = "certified"
    NOT_CERTIFIED = "not_certified"


class Criterion(StrEnum):
    """Which criterion was used.

    published: (29), (31) as printed. certified: docs/theory section 6, for the law that is run.
    """

    PUBLISHED = "published"
    CERTIFIED = "certified"


class Basis(StrEnum):
    """What an instant's local margin rests on.

    exact: the margin itself. bound: the passive bound of that instant, which does not exceed its
    margin because the loop without delay is stable. searched: stable without delay, and no root
    crosses up to this delay. open: not decided.
    """

    EXACT = "exact"
    BOUND = "bound"
    SEARCHED = "searched"
    OPEN = "open"


class Place(StrEnum):
    """Where a loop is frozen.

    posture: in the instant's configuration, tasks without error. rest: where it comes to rest with
    the references as they are, with an error where springs sag.
    """

    POSTURE = "posture"
    REST = "rest"
