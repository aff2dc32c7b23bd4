"""`sealag.certify`: from a design, or its project file, and a motion to a certificate."""

from pathlib import Path

from sealag.design._project import loaded
from sealag.design._system import PROOF_COUNT, System
from sealag.passivity import Certificate, Criterion, Solver
from sealag.robot import Motion
from sealag.simulation import Run


def certify(
    project: System | str | Path,
    motion: Motion | Run | str | Path | None = None,
    *,
    criterion: Criterion | str | None = None,
    time_varying: bool = False,
    proofs: int | None = PROOF_COUNT,
    solver: Solver | None = None,
) -> Certificate:
    """Certify how much delay a design tolerates at every instant of a motion.

    Stability and local margin are decided over all instants, in the instant's configuration itself
    and where the loop that holds it rests.

    Args:
        project: the design, or its project file, `bundled:hume` among them.
        motion: the motion, a run, or a file; the project's own motion if None, or the posture where
            the project names none.
        criterion: certified (docs/theory section 6) or published ((29), (31) as printed); the
            system's own if None.
        time_varying: also bound the delay for matrices that move inside polytopes around the
            motion (about a second more); criterion certified only.
        proofs: how many of the instants with the smallest bounds the certificate holds the numbers
            of; None for all. Those that bind the common multiplier are added.
        solver: where multipliers come from that have no closed form: of several levels, of a whole
            motion, of polytopes; Clarabel's own interface if None. What it says is measured; if it
            leaves open whether the design's delay is proven, the answer is not certified, with the
            solver's own words among the reasons.

    Returns:
        The certificate; not certified is a result, not an error.

    Raises:
        InputError: fewer than one proof is asked for, the project, the criterion or the motion is
            none, or a time-varying bound is asked of one instant or of the published criterion.
        FileError: a file cannot be read.
        RobotError: a mass matrix is not positive definite.
        UnknownNameError: a frame or joint does not exist.
    """
    findings = loaded(project).findings(
        motion, criterion=criterion, time_varying=time_varying, proofs=proofs, solver=solver
    )
    return findings.certificate()
