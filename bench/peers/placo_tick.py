"""PlaCo's DynamicsSolver on ANYmal: four point contacts, CoM and base orientation, one torque tick.

Runs in an environment of its own, since PlaCo needs another Pinocchio than sealag:

    python placo_tick.py ANYMAL.urdf "q_0 … q_18"
"""

import sys

import numpy as np
import placo
from timing import median_us

FEET = ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT")


def main() -> None:
    """Print the microseconds of one tick."""
    robot = placo.RobotWrapper(sys.argv[1], placo.Flags.ignore_collisions)
    q = np.array(sys.argv[2].split(), dtype=float)
    robot.state.q = q
    robot.update_kinematics()
    solver = placo.DynamicsSolver(robot)
    solver.dt = 1e-3
    for foot in FEET:
        task = solver.add_position_task(foot, robot.get_T_world_frame(foot)[:3, 3])
        contact = solver.add_point_contact(task)
        contact.mu = 0.8
    com = solver.add_com_task(robot.com_world())
    com.configure("com", "soft", 1.0)
    base = solver.add_orientation_task("base", robot.get_T_world_frame("base")[:3, :3])
    base.configure("base", "soft", 1.0)

    def tick() -> object:
        robot.state.q = q
        robot.update_kinematics()
        result = solver.solve(False)
        assert result.success
        return result.tau

    print(f"{median_us(tick):.2f}")


if __name__ == "__main__":
    main()
