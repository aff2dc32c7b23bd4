"""The law evaluated at one configuration: compiled, with memory of its own."""

from collections.abc import Callable

import numpy as np

from sealag.errors import ContractionError, RobotError
from sealag.robot import Contact, Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._law import Law
from sealag.whole_body._task_reader import read_tasks
from sealag.whole_body._tasks import (
    FORM_CODE,
    RANK_TOLERANCE,
    GravityCompensation,
    TaskError,
    TaskInertia,
)

SETTLED = 1e-12
"""rad: a smaller Newton step of q̄(θ) is the last. Ten times larger shows in differences of the
command over 1e-5 rad; ten times smaller is lost in rounding of angles."""

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
        law: Law,
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
        from sealag.kernels import control_law, operational_space

        self._kernel = control_law
        self.robot, self.law, self.spring_stiffness = robot, law, spring_stiffness
        frames, self._tasks = read_tasks(robot, law, contacts, posture=posture)
        self._levels, K_x = self._tasks[2], law.gain(robot)
        sizes = robot.nv, robot.n, len(self._tasks[0]), len(K_x)
        self._sizes, self._memory = sizes, np.zeros(operational_space.memory_size(*sizes))
        self.space = operational_space.divide(self._memory, *sizes)
        self._allocate(frames)
        self._gains = (
            K_x,
            self.planned_gravity,
            FORM_CODE[law.stiffness_form],
            law.task_inertia is TaskInertia.LAMBDA_STAR,
            RANK_TOLERANCE,
            law.task_error is TaskError.CONSISTENT,
            self.gravity_is_fed_back,
        )
        self.follow(np.asarray(posture, dtype=float))
        if law.gravity is GravityCompensation.PLANNED:
            self.planned_gravity[:] = self.space.gravity

    def _allocate(self, frames: list[str]) -> None:
        robot = self.robot
        nv, n, c, m = self._sizes
        self._terms = robot.workspace().terms
        self._seen = (
            *robot.frame_mounts(frames), np.zeros((len(frames), 6, nv)),
            np.zeros((len(frames), 3, 3)), np.zeros((len(frames), 3)), np.zeros((len(frames), 6)),
        )  # fmt: skip
        self._J_t, self._J_s = np.zeros((m, nv)), np.zeros((c, nv))
        self.error, self.offset, self.wanted = np.zeros(m), np.zeros(m), np.zeros(m)
        self._motion, self._along = np.zeros(nv), np.zeros((nv, n))
        self.planned_gravity, self._unused = np.zeros(n), np.zeros(n)
        self._step, self._square = np.zeros(n), np.zeros((n, n))
        self._slope, self._slopes = np.zeros((n, n)), (np.zeros((nv, nv)), np.zeros((nv, n)))

    @property
    def rows(self) -> int:
        """Number of task rows m."""
        return len(self.error)

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
        self._along[:] = self.space.joint_from_base

    def at(self, q: Array, joints: Array, out: Array) -> None:
        """Evaluate at a measured configuration (nq,) moved to joint angles (n,); l into out (n,).

        Raises:
            RobotError: the mass matrix is not positive definite.
        """
        good = self._kernel.law(
            self.robot.tree, self._terms, self._seen, self._tasks, self._gains,
            (q, joints, self._along, self.offset),
            (self._J_s, self._J_t, self.error, self.wanted, out), self._memory, self._sizes,
        )  # fmt: skip
        if not good:
            raise RobotError(f"The mass matrix of {self.robot.name} is not positive definite.")

    def settled(self, evaluate: Callable[[], None], away: Callable[[], Array]) -> None:
        """Evaluate again until overline(UN_s) is that of the configuration evaluated.

        Args:
            evaluate: evaluates the law at a signal.
            away: returns how far (n,) the signal is from the measured joint angles.
        """
        for _ in range(_REPEATS):
            evaluate()
            turned = np.abs((self.space.joint_from_base - self._along) @ away()).max(initial=0.0)
            self.keep_following()
            if turned < SETTLED:
                return

    def torque(self, out: Array) -> None:
        """Write l (n,) of the current error and matrices."""
        gravity = self.space.gravity if self.gravity_is_fed_back else self.planned_gravity
        self._kernel.task_torque(self.space.J_star, self.space.stiffness, self.error, gravity, out)

    def leave_to_higher(self, rate: Array) -> None:
        """Project the rates (m,) of the tasks into the null space of the higher tasks, in place."""
        if len(self._levels) > 2:
            self._kernel.leave_to_higher(
                self._J_t, self.space.lift, self._levels, rate, self._motion
            )

    def static(self, q: Array, theta: Array, sag: Array, iterations: int, out: Array) -> None:
        """Evaluate at q̄(θ) of Eqs. (15), (16), by Newton's method from a sag q̄ − θ, in place.

        The springs carry the law there, l(q̄) = K (θ − q̄) = −K sag, so that the last step needs no
        new evaluation.

        Raises:
            ContractionError: q̄(θ) does not exist, or is not found.
        """
        K, space, step = self.spring_stiffness, self.space, self._step
        for _ in range(iterations):
            self.at(q, theta + sag, out)
            if self.gravity_is_fed_back:
                self._kernel.gravity_slope(
                    self.robot.tree, self._terms, space.joint_from_base, *self._slopes, self._slope
                )
            exists = self._kernel.static_step(
                space.J_star,
                self._moved(),
                space.stiffness,
                self._slope,
                K,
                out,
                sag,
                self._square,
                step,
            )
            size = float(np.abs(step).max())
            if not (exists and size < DIVERGED):
                raise self._without_static_state(size)
            if size < SETTLED:
                break
        out[:] = -K * sag
        self.error -= self._moved() @ step

    def _moved(self) -> Array:
        """Minus the errors' Jacobian (m, n) by joint angles, where the law was last evaluated."""
        if self.law.task_error is TaskError.CONSISTENT:
            return self.space.J_star
        return self._J_t @ self.space.joint_from_base

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
        away = joints - self.robot.joint_positions(q)
        self.at(q, self.robot.joint_positions(q), self._unused)
        work = float(self._terms[10][1])
        for place, weight in _GAUSS:
            self.at(q, self.robot.joint_positions(q) + place * away, self._unused)
            work += weight * float(self.space.gravity @ away)
        return work
