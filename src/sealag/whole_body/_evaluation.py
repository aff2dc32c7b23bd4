"""The law evaluated at one configuration: compiled, with memory of its own."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from sealag.errors import ContractionError, RobotError
from sealag.kernels import keep
from sealag.robot import Contact, Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._tank import EnergyTank, TankFlow
from sealag.whole_body._task_law import TaskLaw
from sealag.whole_body._task_reader import read_tasks
from sealag.whole_body._tasks import (
    FORM_CODE,
    RANK_TOLERANCE,
    GravityCompensation,
    TaskError,
    TaskInertia,
)

if TYPE_CHECKING:
    from sealag.kernels.control_law import Control, Followed, Gains, Tasks

SETTLED = 1e-12
"""rad: a smaller Newton step of q̄(θ) is the last. Ten times larger shows in differences of the
command over 1e-5 rad; ten times smaller is lost in rounding of angles."""

_FIRST = 60
"""Newton steps towards q̄(θ) from a first guess; a handful is enough where it exists."""

DIVERGED = 10.0
"""rad: a Newton step of more than a turn means that there is no solution nearby."""

_GAUSS = ((0.5 - 0.5 / 3**0.5, 0.5), (0.5 + 0.5 / 3**0.5, 0.5))  # places and weights on 0 … 1
_REPEATS = 50


class LawEvaluation:
    """l = J*ᵀ S x̃ + ḡ and all that it is made of, at joint angles that a signal chooses.

    The configuration is the measured one, moved by overline(UN_s) (q_chosen − q_measured): the base
    follows the chosen joint angles as contacts demand.

    Attributes:
        robot: the robot.
        law: the law.
        spring_stiffness: (n,) K, Nm/rad.
        space: J*, S, ḡ and the motions where it was last evaluated.
        error: (m,) x̃ there.
        wanted: (m,) x_d there, relative to the posture's.
    """

    def __init__(
        self,
        robot: Robot,
        law: TaskLaw,
        spring_stiffness: Array,
        *,
        contacts: tuple[Contact, ...],
        posture: ArrayLike,
    ) -> None:
        """Measure the references at a posture, and evaluate the law there.

        Args:
            robot: the robot.
            law: the law.
            spring_stiffness: (n,) K, Nm/rad.
            contacts: which frames are held.
            posture: (nq,) configuration whose task positions are the references, and where
                planned gravity compensation is taken.

        Raises:
            InputError: the posture has another shape.
            UnknownNameError: a frame or joint does not exist.
            RobotError: the mass matrix at the posture is not positive definite.
        """
        from sealag.kernels import control_law

        self._kernel = control_law
        self.robot, self.law, self.spring_stiffness = robot, law, spring_stiffness
        frames, tasks = read_tasks(robot, law, contacts, posture=posture)
        gains = control_law.Gains(
            K_x=law.gain(robot),
            planned_gravity=np.zeros(robot.n),
            springs=spring_stiffness,
            form=FORM_CODE[law.stiffness_form],
            star=law.task_inertia is TaskInertia.LAMBDA_STAR,
            tolerance=RANK_TOLERANCE,
            consistent=law.task_error is TaskError.CONSISTENT,
            fed_back=law.gravity is GravityCompensation.FEEDBACK,
        )
        self.planned_gravity, self._measured = gains.planned_gravity, self.running()
        self._drag = law.drag(robot)
        self._kept = keep(self._allocate(frames, tasks, gains))
        self.follow(np.asarray(posture, dtype=float))
        if law.gravity is GravityCompensation.PLANNED:
            self.planned_gravity[:] = self.space.gravity

    def _allocate(self, frames: list[str], tasks: "Tasks", gains: "Gains") -> "Control":
        """Return the law with memory for all that is evaluated."""
        from sealag.kernels import dynamics, operational_space

        robot, kernel = self.robot, self._kernel
        nv, n, c, m = robot.nv, robot.n, len(tasks.contact_row), len(tasks.row)
        self.space = operational_space.allocate(nv, n, c, m=m)
        self._terms = dynamics.allocate(robot.tree)
        self._at = kernel.Evaluation(
            along=np.zeros((nv, n)), offset=np.zeros(m), shift=np.zeros(nv), q=np.zeros(robot.nq),
            J_s=np.zeros((c, nv)), J_t=np.zeros((m, nv)), error=np.zeros(m), wanted=np.zeros(m),
            joints=np.zeros(n), twist=np.zeros(6), target=np.zeros(m), moved=np.zeros(m),
            pull=np.zeros(m),
        )  # fmt: skip
        self.error, self.offset, self.wanted = self._at.error, self._at.offset, self._at.wanted
        newton = kernel.Newton(
            H=np.zeros((nv, nv)), moved=np.zeros((nv, n)), slope=np.zeros((n, n)),
            J=np.zeros((m, n)), force=np.zeros((m, n)), square=np.zeros((n, n)),
            step=np.zeros(n),
        )  # fmt: skip
        self._newton, self._levels, self._unused = newton, tasks.levels, np.zeros(n)
        return kernel.Control(
            tree=robot.tree, mounts=robot.frame_mounts(frames), tasks=tasks, gains=gains,
            terms=self._terms, frames=dynamics.allocate_frames(len(frames), nv), at=self._at,
            newton=newton, space=self.space,
        )  # fmt: skip

    @property
    def rows(self) -> int:
        """Number of task rows m."""
        return len(self.error)

    @property
    def configuration(self) -> Array:
        """(nq,) where the law was last evaluated."""
        return self._at.q

    @property
    def fed_back(self) -> Array:
        """(n,) joint angles that it was moved towards, rad."""
        return self._at.joints

    @property
    def gravity_is_fed_back(self) -> bool:
        """Whether ḡ is taken at the fed-back configuration."""
        return self.law.gravity is GravityCompensation.FEEDBACK

    @property
    def contraction(self) -> float:
        """‖K^-½ J*ᵀ S J K^-½‖ where the law was last evaluated, −J the errors' Jacobian: the tasks'
        part of the factor below which q̄(θ) exists."""
        root = np.sqrt(self.spring_stiffness)
        F = self.space.J_star.T @ self.space.stiffness @ self._moved()
        return float(np.linalg.norm(F / np.outer(root, root), 2))

    def follow(self, q: Array) -> None:
        """Evaluate at a configuration, and take overline(UN_s) from there."""
        self.at(q, self.robot.joint_positions(q), self._unused)
        self.keep_following()

    def keep_following(self) -> None:
        """Take overline(UN_s) from where the law was last evaluated."""
        self._at.along[:] = self.space.joint_from_base

    def at(self, q: Array, joints: Array, out: Array) -> None:
        """Evaluate at a measured configuration (nq,) moved to joint angles (n,); l into out (n,).

        Raises:
            RobotError: the mass matrix is not positive definite.
        """
        self.tick(self._measured, 0.0, q, joints, out)

    def tick(self, signal: Any, period: float, q: Array, angles: Array, out: Array) -> None:
        """Evaluate at a running signal, which moves.

        Args:
            signal: from `running`.
            period: since the last tick, s.
            q: (nq,) measured configuration.
            angles: (n,) joint angles of a measured signal, motor angles of another one, rad.
            out: (n,) torque, Nm, written.

        Raises:
            ContractionError: q̄(θ) does not exist, or is not found.
            RobotError: the mass matrix is not positive definite.
        """
        status = self._kernel.tick(self._kept, signal, period, q, angles, out)
        if status == self._kernel.SINGULAR_MASS:
            raise RobotError(f"The mass matrix of {self.robot.name} is not positive definite.")
        if status == self._kernel.NO_STATIC_STATE:
            raise self._without_static_state(float(np.abs(self._newton.step).max()))

    def running(
        self,
        *,
        static: "Followed | None" = None,
        iterations: int = 1,
        tank: EnergyTank | None = None,
    ) -> Any:
        """Return a running signal as kernels take it: measured angles, q̄(θ) or x̂ of a tank.

        Args:
            static: q̄(θ) from tick to tick, moved; None for measured angles.
            iterations: Newton steps towards q̄(θ) a tick at most; the first one searches until it
                has settled.
            tank: lets x̂ follow x(q̄(θ)).
        """
        kernel = self._kernel
        kind = kernel.MEASURED if static is None else kernel.STATIC
        if tank is None:
            tank = EnergyTank(
                rows=0, energy=0.0, rate=0.0, delay_bound=0.0, flow=TankFlow.CORRECTED
            )
        else:
            kind = kernel.TANK
        signal = kernel.Signal(
            kind=kind, first=_FIRST, iterations=iterations, settled=SETTLED, diverged=DIVERGED,
            static=static or self.followed(np.zeros(self.robot.n)), tank=tank.memory,
        )  # fmt: skip
        return keep(signal)

    def followed(self, sag: Array) -> "Followed":
        """Return memory of q̄(θ) from tick to tick, with a first guess of its sag (n,), live."""
        n = self.robot.n
        return self._kernel.Followed(
            sag=sag, theta=np.zeros(n), answer=np.zeros((n, n)), started=np.zeros(1, np.int64)
        )

    def settled(self, evaluate: Callable[[], None], away: Callable[[], Array]) -> None:
        """Evaluate again until overline(UN_s) is that of the configuration evaluated.

        Args:
            evaluate: evaluates the law at a signal.
            away: returns how far (n,) the signal is from the measured joint angles.
        """
        for _ in range(_REPEATS):
            evaluate()
            turned = np.abs((self.space.joint_from_base - self._at.along) @ away()).max(initial=0.0)
            self.keep_following()
            if turned < SETTLED:
                return

    def task_energy(self) -> float:
        """Return ½ x̃ᵀ S x̃ of the current error and matrices, J."""
        return 0.5 * float(self.error.dot(self.space.stiffness.dot(self.error)))

    def torque(self, out: Array) -> None:
        """Write l (n,) of the current error and matrices."""
        space = self.space
        gravity = space.gravity if self.gravity_is_fed_back else self.planned_gravity
        out[:] = space.J_star.T @ (space.stiffness @ self.error) + gravity

    def drag(self, rates: Array, wanted: Array | None) -> Array:
        """Return J*ᵀ D_x (ẋ_d − J* q̇) (n,), Nm, where the law was last evaluated.

        Args:
            rates: (n,) measured, rad/s.
            wanted: (m,) ẋ_d; None for 0.
        """
        J_star = self.space.J_star
        away = -(J_star @ rates) if wanted is None else wanted - J_star @ rates
        return J_star.T @ (self._drag @ away)

    def drag_slope(self) -> Array:
        """Return −J*ᵀ D_x J* (n, n), Nms/rad, where the law was last evaluated."""
        return -self.space.J_star.T @ self._drag @ self.space.J_star

    def leave_to_higher(self, rate: Array) -> None:
        """Project the rates (m,) of the tasks into the null space of the higher tasks, in place."""
        from sealag.kernels.task_error import leave_to_higher

        if len(self._levels) > 2:
            leave_to_higher(self._at.J_t, self.space.lift, self._levels, rate, self._at.shift)

    def static(self, q: Array, theta: Array, sag: Array, out: Array) -> None:
        """Evaluate at q̄(θ) of Eqs. (15), (16), by Newton's method from a sag q̄ − θ, moved.

        Raises:
            ContractionError: q̄(θ) does not exist, or is not found.
            RobotError: the mass matrix is not positive definite.
        """
        self.tick(self.running(static=self.followed(sag)), 0.0, q, theta, out)

    def _moved(self) -> Array:
        """Minus the errors' Jacobian (m, n) by joint angles, where the law was last evaluated."""
        if self.law.task_error is TaskError.CONSISTENT:
            return self.space.J_star
        return self._at.J_t @ self.space.joint_from_base

    def _without_static_state(self, step: float) -> ContractionError:
        if self.contraction >= 1.0:
            return ContractionError(
                "q̄(θ) does not exist: the task is stiffer than the springs "
                f"(contraction factor {self.contraction:.2f}; below 1 is needed)."
            )
        return ContractionError(
            f"q̄(θ) is not found: Newton's step towards it is {step:.2g} rad. The springs can hold "
            f"the task's stiffness (contraction factor {self.contraction:.2f}), but its error is "
            "out of reach: is the reference too far away?"
        )

    def work_of_gravity(self, q: Array, joints: Array) -> float:
        """Return U_g of a measured configuration plus ∫ ḡᵀ dq_j from there to joint angles, J."""
        from sealag.kernels.dynamics import POTENTIAL

        away = joints - self.robot.joint_positions(q)
        self.at(q, self.robot.joint_positions(q), self._unused)
        work = float(self._terms.energy[POTENTIAL])
        for place, weight in _GAUSS:
            self.at(q, self.robot.joint_positions(q) + place * away, self._unused)
            work += weight * float(self.space.gravity @ away)
        return work
