"""A design that answers: bounds, margins, motions and runs."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sealag.design._along import Along
from sealag.design._criteria import certified_bounds
from sealag.design._design import Design
from sealag.design._findings import Findings
from sealag.design._local import Local, local_of
from sealag.design._margins import LocalMargins, local_margins
from sealag.design._motion_file import load_motion, motion_of_run, save_motion
from sealag.design._rates import RATES, Rate, rate_sweep
from sealag.design._standing import standing_warnings
from sealag.errors import InputError, either
from sealag.passivity import Bound, Criterion, Solver
from sealag.robot import Motion
from sealag.typing import Array
from sealag.whole_body import Rest, Spaces

if TYPE_CHECKING:
    from sealag.simulation import Run

MOST_INSTANTS = 1_400_000
"""Instants of one certificate: its file has at most 100 MB, and up to 70 bytes an instant."""

PROOF_COUNT = 12
"""Instants whose numbers a certificate holds if nothing else is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class System(Design):
    """A robot with its actuators, law and delays, in SI units: what is certified, frozen, simulated
    and run.

    Attributes:
        robot: the robot.
        actuators: its series elastic actuators.
        law: the whole-body control law.
        program: makes the controller that runs instead of the law, which is without effect then;
            None for the law.
        posture: (nq,) configuration that the law holds, and that is certified without a motion.
        delays: both connections' delays, with the period of a controller that runs: the hold of
            one that states none counts too.
        contacts: which frames are held when a motion does not say it.
        name: what messages and files call it.
        criterion: the criterion that certifies by default.
        simulation: how it is simulated.
        walking: a walk; None if there is none.
        source: the project file that it was read from; None if it was built in Python.
    """

    def load_motion(
        self,
        path: str | Path,
        *,
        columns: Mapping[str, str] | str | Path | None = None,
        quaternion: str | None = None,
        tell: Callable[[str], None] = warnings.warn,
    ) -> Motion:
        """Read a motion from a table with named columns, in any order: CSV, NPZ, Parquet, or a
        recording (MCAP) of a run.

        Columns: a time, `time_s`, or `time_ms`, `time_us`, `time_ns`, `stamp_ns` and their like;
        for a floating base `base_x … base_z` (m) and `base_qx … base_qw`; one for each joint by its
        name (rad or m). Optional: `<joint>:velocity` for all joints together with
        `base_vx … base_wz` in the base frame, else velocities are differences of configurations;
        and `contact:<frame>` with 1 where the design's contact at this frame holds, else all hold.
        In an NPZ also `name` (n,), `position` and `velocity` (N, n) of ROS's JointState. Other
        columns are left out. Without the base's pose it is where contacts stay as they are, from
        the posture on, if three points or a surface hold. In a recording a contact holds where all
        of its points stick. A date as time begins at 0.

        Args:
            path: the file; its ending tells the format.
            columns: which of its columns are which of these: a mapping, `theirs=ours,…`, or a TOML
                or JSON file.
            quaternion: order of base_qx … base_qw in the file, xyzw or wxyz; None for xyzw, if the
                base is not turned over against the posture and does not jump.
            tell: called with each sentence on what was left out or taken for granted.

        Returns:
            The motion.

        Raises:
            FileError: the file cannot be read.
            InputError: columns or quaternion are neither of these.
            MotionError: a column is missing or holds no real numbers, a time does not say its unit,
                a row is not finite, time does not increase, a quaternion is not one or looks as if
                w came first, a joint is outside its limits, a contact is none of the design's or
                neither 0 nor 1, contacts leave the base free or contradict the joints, or only some
                velocities are given.
        """
        return load_motion(path, self, columns=columns, quaternion=quaternion, tell=tell)

    def motion_of(
        self,
        given: "Motion | Run | str | Path | None" = None,
        *,
        columns: Mapping[str, str] | str | Path | None = None,
        quaternion: str | None = None,
        tell: Callable[[str], None] = warnings.warn,
    ) -> Motion:
        """Return the motion that an answer is of.

        Args:
            given: a motion, a run, or a file; None for the project's own motion, or the posture
                where the project names none. `still` is always the posture.
            columns: for a file, as `load_motion` takes it.
            quaternion: for a file, as `load_motion` takes it.
            tell: for a file, as `load_motion` takes it.

        Raises:
            InputError: it is none of these, or a run of another robot.
            FileError: as `load_motion` raises it; so MotionError.
        """
        chosen = self.motion_file if given is None else given
        if isinstance(chosen, str | Path):
            return self.load_motion(chosen, columns=columns, quaternion=quaternion, tell=tell)
        if columns is not None or quaternion is not None:
            raise InputError("columns and quaternion are of a motion's file; name it (--motion).")
        if chosen is None:
            return self.still()
        if isinstance(chosen, Motion):
            return chosen
        from sealag.simulation import Run

        if isinstance(chosen, Run):
            return motion_of_run(chosen, self)
        raise InputError(f"motion is {chosen!r}; a Motion, a Run or a file's path is needed.")

    def save_motion(self, motion: Motion, path: str | Path) -> None:
        """Write a motion of the robot as CSV, NPZ or Parquet through a temporary name.

        Args:
            motion: the motion.
            path: the file; its ending tells the format.

        Raises:
            FileError: it cannot be written.
            MotionError: the ending is none of the three.
        """
        save_motion(motion, self.robot, path)

    def warnings(self, motion: Motion | None = None) -> tuple[str, ...]:
        """Return what keeps a floating-base robot from standing as the design says: no contacts, a
        foot above or below the others, a centre of mass outside the feet; along a motion also a
        foot that moves while it holds.

        Args:
            motion: what is certified; the posture if None.
        """
        return standing_warnings(self, motion)

    def local(
        self, bounds: Array, motion: Motion | None = None, *, rest: Rest | None = None
    ) -> Local:
        """Decide stability and margin of the law that runs at every instant of a motion.

        Args:
            bounds: (N,) of the certified criterion, s; 0 where it decides nothing.
            motion: its instants; the posture if None.
            rest: where the loop of the first instant rests, if that is known already.
        """
        return local_of(Along.of(self, motion), bounds, rest)

    def local_margins(
        self, motion: "Motion | Run | str | Path | None" = None, *, horizon: float | None = None
    ) -> LocalMargins:
        """Decide the exact local margin of the law that runs, and its jitter margin, over a motion.

        The margin is necessary and sufficient for local stability at constant delay with frozen
        coefficients, the jitter margin sufficient for delays that vary; both at the equilibrium of
        the loop that holds an instant. The delay is d_1, the sum of all ways around the loop;
        delayed torque feedback in the drives has a delay of its own. Instants that a potential
        decides are computed only where their passive bound lies below the smallest margin.

        Args:
            motion: the motion or its file; as `motion_of` takes it.
            horizon: longest delay up to which the ranges of stable and unstable delay are listed,
                s.

        Raises:
            InputError: the horizon is not a positive time.
            ContractionError: q̄(θ) is fed back and does not exist.
            SolverError: the margin at the instant that sets it could not be decided.
        """
        return local_margins(Along.of(self, self.motion_of(motion)), horizon)

    def rate_sweep(self, rates: Sequence[float] = RATES) -> tuple[Rate, ...]:
        """Return what each sample rate tolerates, in the posture; docs/theory section 7.6.

        The controller samples, computes and holds once a period; its delay is that of the design's
        links without the hold. Where the law sags, posture and rest both count.

        Args:
            rates: Hz; the design's own comes on top.

        Raises:
            InputError: torque feedback is late in the drives: the loop has two delays.
            ContractionError: q̄(θ) is fed back and does not exist.
            SolverError: rounding leaves a jitter margin open.
        """
        return rate_sweep(self, rates)

    def gait_margin(self, *, jobs: int = 2) -> Any:
        """Find up to which constant delay the [walking] section's gait is stable; see
        docs/theory section 12.1.

        The step-to-step map of the simulated walk on level ground is differentiated: links,
        motors, delay lines and the controller's memory. All ways are late in the proportion of the
        design's mean delays.

        Args:
            jobs: number of processes.

        Returns:
            Floquet multipliers at each delay that was tried, `delay_s`, the largest at which the
            gait is stable, and `walks_s` and `falls_s`, between which the simulated walk falls.

        Raises:
            InputError: there is no walk, the delays are 0, or a step is no whole number of periods.
        """
        from sealag.design._clock import clock_of
        from sealag.simulation import MeasuredGait

        return MeasuredGait.margin(
            self.robot,
            self.actuators,
            self.required_walking(),
            delays=self.delays,
            clock=clock_of(self),
            jobs=jobs,
        )

    def certified_bounds(
        self, spaces: Spaces, rest: Rest | None = None, motion: Motion | None = None
    ) -> Bound:
        """Bound every instant by the criterion of docs/theory section 6 for the law that is run.

        Sufficient for a passive controller side along the frozen motion: the signal is one that a
        potential can belong to, the drives are ideal, the motors carry the static load, no contact
        or task is singular, the whole delayed stiffness F_θ is symmetric, the task stiffness
        positive semidefinite, and d_1 ≤ 1 / w(D^-½ F_θ D^-½).

        Args:
            spaces: the law's matrices.
            rest: where the loop rests in its posture; None for a motion.
            motion: whose speeds the motors must reach; None for a posture.

        Returns:
            The bound of each instant, 0 where a condition fails.
        """
        return certified_bounds(spaces, self, rest, motion)

    def criterion_asked(
        self,
        motion: "Motion | Run | str | Path | None" = None,
        criterion: Criterion | str | None = None,
        *,
        time_varying: bool = False,
        proofs: int | None = PROOF_COUNT,
    ) -> Criterion:
        """Return the criterion that `certify` would use, if what it is asked has an answer.

        Args:
            motion: the motion, as `motion_of` takes it.
            criterion: what is asked for, or None.
            time_varying: whether a bound for matrices that move is asked for.
            proofs: how many instants with their numbers; None for all.

        Raises:
            InputError: as `certify` raises it.
        """
        self.require_law("A certificate's bounds are")
        motion = self.motion_of(motion)
        if len(motion) > MOST_INSTANTS:
            raise InputError(
                f"The motion has {len(motion)} instants; a certificate holds {MOST_INSTANTS} at "
                "most. Certify parts of the motion, or fewer of its rows."
            )
        if proofs is not None and not (isinstance(proofs, int) and proofs >= 1):
            raise InputError(f"proofs is {proofs!r}; it must be a whole number from 1 up, or None.")
        name = self.criterion if criterion is None else criterion
        if name not in set(Criterion):
            raise InputError(f"criterion is {name!r}; it must be {either(list(Criterion))}.")
        if name == Criterion.PUBLISHED and motion.stiffness is not None:
            raise InputError(
                "The motion has a stiffness_factor, and the published criterion is of gains that "
                "stay; certify by the certified one, or leave the column out."
            )
        if time_varying and (name == Criterion.PUBLISHED or len(motion) < 2):
            raise InputError(
                "A time-varying bound needs the certified criterion and a motion of more than one "
                "instant (--motion)."
            )
        return Criterion(name)

    def findings(
        self,
        motion: "Motion | Run | str | Path | None" = None,
        criterion: Criterion | str | None = None,
        *,
        time_varying: bool = False,
        proofs: int | None = PROOF_COUNT,
        solver: Solver | None = None,
    ) -> Findings:
        """Compute all that certificates of the design along a motion rest on.

        `findings().certificate()` is what `sealag.certify` returns; `findings().confirmed(delays)`
        gives, in milliseconds, what it and its check come to for the design with other delays.

        Args:
            motion: as `sealag.certify` takes it; so the others.
            criterion: which one.
            time_varying: whether a bound for matrices that move is asked for.
            proofs: how many instants with their numbers; None for all.
            solver: where multipliers come from.

        Raises:
            InputError: as `certify` raises it; so the others.
        """
        along = self.motion_of(motion)
        kind = self.criterion_asked(along, criterion, time_varying=time_varying, proofs=proofs)
        return Findings.of(
            self, along, kind=kind, time_varying=time_varying, proofs=proofs, solver=solver
        )
