"""A design: robot, actuators, controller and delays."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sealag.actuation import Actuators
from sealag.delay import Delays
from sealag.design._schema import SimulationSection
from sealag.design._walking import Walking
from sealag.passivity import Criterion
from sealag.robot import Contact, Motion, Robot
from sealag.typing import Array
from sealag.whole_body import (
    Feedback,
    GravityCompensation,
    Hierarchy,
    Linearisation,
    TankFlow,
    TaskError,
    WholeBodyStack,
    evaluate,
    linearise,
    passive_stiffness,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tank:
    """The energy tank of a design.

    Attributes:
        flow: what its energy pays for.
        energy: at the start, J.
        rate: at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
    """

    flow: TankFlow = TankFlow.CORRECTED
    energy: float = 1.0
    rate: float = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """A robot with its actuators, controller and delays: what a project file describes.

    Attributes:
        name: the project file's name.
        robot: the robot.
        actuators: its series elastic actuators.
        hierarchy: the controller's tasks.
        contacts: which frames are held when a motion does not say it.
        posture: (nq,) configuration that is certified without a motion.
        feedback: the signal that is fed back.
        gravity: where gravity compensation takes its configuration from.
        task_error: which error tasks below the first level feed back.
        tank: flow, energy and rate of the energy tank, for feedback through it.
        criterion: the criterion that certifies by default.
        delays: both loops' delays.
        motion_file: the project's own motion, if it names one.
        sha256: of the project file; empty if the system was built in Python.
        simulation: the project's [simulation] section.
        walking: the walk that the project describes; None if it has no [walking] section.
        text: the project file's own text, which recordings carry along.
        files: everything that it was read from: project, URDF, motion, delay samples.
    """

    name: str
    robot: Robot
    actuators: Actuators
    hierarchy: Hierarchy
    contacts: tuple[Contact, ...]
    posture: Array
    feedback: Feedback
    gravity: GravityCompensation
    task_error: TaskError
    tank: Tank
    criterion: Criterion
    delays: Delays
    motion_file: Path | None
    sha256: str
    simulation: SimulationSection
    walking: Walking | None
    text: str
    files: tuple[Path, ...]

    def still(self) -> Motion:
        """Return the posture as a motion of one instant."""
        return Motion(
            time=np.zeros(1),
            q=self.posture[None],
            v=np.zeros((1, self.robot.nv)),
            contact_sets=(self.contacts,),
            contact_index=np.zeros(1, dtype=np.int64),
        )

    def evaluate(self, motion: Motion) -> WholeBodyStack:
        """Return the controller's matrices along a motion.

        Args:
            motion: its instants.

        Raises:
            RobotError: a mass matrix is not positive definite.
        """
        return evaluate(
            self.robot,
            self.hierarchy,
            self.actuators,
            motion=motion,
            feedback=self.feedback,
            gravity=self.gravity,
            task_error=self.task_error,
        )

    def frozen(self, motion: Motion, stack: WholeBodyStack, instant: int) -> Linearisation:
        """Return the closed loop of the law that is run, frozen at one instant.

        Args:
            motion: its instants.
            stack: the controller's matrices along it.
            instant: which one.
        """
        q, contacts = motion.q[instant], motion.contact_sets[motion.contact_index[instant]]
        passive = passive_stiffness(
            self.robot,
            self.hierarchy,
            self.actuators,
            q=q,
            contacts=contacts,
            feedback=self.feedback,
            gravity=self.gravity,
            task_error=self.task_error,
        )
        return linearise(
            self.robot,
            self.actuators,
            q,
            contacts=contacts,
            F=stack.F_theta[instant],
            feedback=self.feedback,
            F_passive=passive,
        )
