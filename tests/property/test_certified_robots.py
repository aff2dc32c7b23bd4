"""No delay that is both certified and stable exceeds the exact local margin, on real robots."""

from dataclasses import replace

import numpy as np
import pytest

from sealag.design import ASYMMETRY_TOLERANCE, certified_bounds, load
from sealag.errors import SolverError
from sealag.margin import delay_margin
from sealag.robot import Contact, ContactKind, Motion
from sealag.whole_body import Feedback, GravityCompensation, evaluate, linearise

SEED, CONFIGURATIONS = 4, 100


def configurations(system):
    rng = np.random.default_rng(SEED)
    steps = rng.normal(size=(CONFIGURATIONS, system.robot.nv)) * 0.15
    steps[:, : system.robot.nv_base] = 0.0
    return np.array([system.robot.integrate(system.posture, step) for step in steps])


CASES = [
    ("examples/baxter.toml", Feedback.STATIC_JOINT, GravityCompensation.FEEDBACK, 50),
    ("examples/baxter.toml", Feedback.MOTOR, GravityCompensation.NONE, 1),
    ("examples/anymal.toml", Feedback.STATIC_JOINT, GravityCompensation.PLANNED, 50),
    ("examples/anymal.toml", Feedback.MOTOR, GravityCompensation.FEEDBACK, 0),
    ("bundled:hume", Feedback.MOTOR, GravityCompensation.PLANNED, 0),
    ("clamped hume", Feedback.MOTOR, GravityCompensation.PLANNED, 90),
    ("clamped hume", Feedback.STATIC_JOINT, GravityCompensation.PLANNED, 50),
]


def design(project):
    """Hume on its point feet has no stable equilibrium; held by one foot, and stiff, it has."""
    if project != "clamped hume":
        return load(project)
    system = load("bundled:hume")
    tasks = tuple(replace(task, stiffness=10.0 * task.stiffness) for task in system.hierarchy.tasks)
    return replace(
        system,
        hierarchy=replace(system.hierarchy, tasks=tasks),
        actuators=replace(system.actuators, spring_stiffness=np.full(6, 2e4)),
        contacts=(
            Contact(frame="right_foot", kind=ContactKind.SURFACE),
            Contact(frame="left_foot"),
        ),
    )


@pytest.mark.parametrize(("project", "feedback", "gravity", "least"), CASES)
def test_certified_and_stable_never_exceeds_the_margin(project, feedback, gravity, least):
    system = replace(design(project), feedback=feedback, gravity=gravity)
    q = configurations(system)
    motion = Motion(
        time=np.arange(len(q)) * 1.0,
        q=q,
        v=np.zeros((len(q), system.robot.nv)),
        contact_sets=(system.contacts,),
        contact_index=np.zeros(len(q), dtype=np.int64),
    )
    stack = evaluate(
        system.robot, system.hierarchy, system.actuators, motion=motion,
        feedback=feedback, gravity=gravity,
    )  # fmt: skip
    bounds = certified_bounds(stack, system)
    compared, undecided = 0, 0
    for k in np.flatnonzero((bounds.delay > 0.0) & (stack.asymmetry <= ASYMMETRY_TOLERANCE)):
        frozen = linearise(
            system.robot, system.actuators, q[k], contacts=system.contacts,
            F=stack.F_theta[k], feedback=feedback,
        )  # fmt: skip
        if not frozen.stable:
            continue
        try:
            margin = delay_margin(frozen.A_0, frozen.A_1, symmetries=frozen.symmetries).delay
        except SolverError:
            undecided += 1
            continue
        compared += 1
        assert bounds.delay[k] <= margin * (1.0 + 1e-9)
    assert compared >= least, f"only {compared} of {CONFIGURATIONS} were compared"
    assert undecided <= 5
