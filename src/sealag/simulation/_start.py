"""Where a run starts."""

from typing import Required, TypedDict

from sealag.typing import Array


class Start(TypedDict, total=False):
    """The first state of a run.

    Attributes:
        q: Configuration (nq,); needed.
        v: Velocity (nv,); at rest if not given.
        theta: Motor angles (n,), rad; such that the springs carry the controller's first command
            if not given.
        theta_dot: Motor speeds (n,), rad/s; the joint rates if not given.
    """

    q: Required[Array]
    v: Array | None
    theta: Array | None
    theta_dot: Array | None
