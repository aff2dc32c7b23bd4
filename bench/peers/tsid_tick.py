"""TSID on ANYmal: four point contacts, CoM and base orientation, one torque tick.

Runs in an environment of its own, since TSID needs another Pinocchio than sealag:

    python tsid_tick.py ANYMAL.urdf "q_0 … q_18"
"""

import sys

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid
from timing import median_us

FEET = ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT")


def main() -> None:
    """Print the microseconds of one tick."""
    robot = tsid.RobotWrapper(sys.argv[1], [""], pin.JointModelFreeFlyer(), False)
    q, v = np.array(sys.argv[2].split(), dtype=float), np.zeros(robot.nv)
    formulation = tsid.InverseDynamicsFormulationAccForce("anymal", robot, False)
    formulation.computeProblemData(0.0, q, v)
    data, model = formulation.data(), robot.model()
    contacts = []  # the formulation keeps references only
    for foot in FEET:
        contact = tsid.ContactPoint(foot, robot, foot, np.array([0.0, 0.0, 1.0]), 0.8, 0.0, 1e4)
        contact.setKp(100.0 * np.ones(3))
        contact.setKd(20.0 * np.ones(3))
        contact.setReference(robot.framePosition(data, model.getFrameId(foot)))
        formulation.addRigidContact(contact, 1e-5)
        contacts.append(contact)
    com = tsid.TaskComEquality("com", robot)
    com.setKp(100.0 * np.ones(3))
    com.setKd(20.0 * np.ones(3))
    com.setReference(tsid.TrajectoryEuclidianConstant("com", robot.com(data)).computeNext())
    formulation.addMotionTask(com, 1.0, 1, 0.0)
    base = tsid.TaskSE3Equality("base", robot, "base")
    base.setKp(100.0 * np.ones(6))
    base.setKd(20.0 * np.ones(6))
    base.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
    placed = robot.framePosition(data, model.getFrameId("base"))
    base.setReference(tsid.TrajectorySE3Constant("base", placed).computeNext())
    formulation.addMotionTask(base, 1.0, 1, 0.0)
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(1.0 * np.ones(robot.na))
    posture.setKd(2.0 * np.ones(robot.na))
    posture.setReference(tsid.TrajectoryEuclidianConstant("posture", q[7:]).computeNext())
    formulation.addMotionTask(posture, 1e-4, 1, 0.0)
    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)

    def tick() -> object:
        problem = formulation.computeProblemData(0.0, q, v)
        solution = solver.solve(problem)
        assert solution.status == 0
        return formulation.getActuatorForces(solution)

    print(f"{median_us(tick):.2f}")


if __name__ == "__main__":
    main()
