"""The first law from logged books."""

from sealag.kernels.ledger import IMPACT, MOTOR_WORK, VISCOUS
from sealag.typing import Array


def residual(stores: Array, joint: Array, scalar: Array, first: float) -> Array:
    """Return energy present less energy expected from all works (N,), J, of logged books.

    Zero but for the integrator: stores (N, 4), joint works (N, 9, n) and other works (N, 5) come
    from separate integrals. At the start ``first`` was stored.
    """
    present = stores.sum(axis=1) - first
    works = joint.sum(axis=2)
    lost = works[:, VISCOUS:].sum(axis=1) + scalar[:, IMPACT]
    return present - works[:, MOTOR_WORK] + lost - scalar[:, :IMPACT].sum(axis=1)
