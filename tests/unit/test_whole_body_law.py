"""The law as one value: its order, its levels, its gains, and what it refuses to be."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from sealag.design import load
from sealag.errors import InputError, UnknownNameError
from sealag.whole_body import (
    GravityCompensation,
    Law,
    LinkAngles,
    MotorAngles,
    Signal,
    StaticJoint,
    StiffnessForm,
    Tank,
    Task,
    TaskError,
    TaskInertia,
    TaskKind,
)

HUME = load("bundled:hume")
ROBOT = HUME.robot


def posture(name, *, priority=1, stiffness=1.0, joints=()):
    return Task(
        name=name, kind=TaskKind.POSTURE, stiffness=stiffness, priority=priority, joints=joints
    )


def test_tasks_are_ordered_by_priority_and_of_equal_priority_as_given():
    tasks = (posture("c", priority=2), posture("a"), posture("d", priority=2), posture("b"))
    law = Law(tasks=tasks)
    assert [task.name for task in law.ordered] == ["a", "b", "c", "d"]
    assert law.tasks == tasks
    turned = replace(law, tasks=tasks[::-1])
    assert [task.name for task in turned.ordered] == ["b", "a", "d", "c"]


def test_levels_and_gains_follow_that_order():
    com = Task(name="com", kind=TaskKind.COM, stiffness=[1.0, 2.0, 3.0], priority=2)
    legs = posture("legs", joints=ROBOT.joints[:2], stiffness=[[5.0, 1.0], [1.0, 4.0]])
    low = posture("all", stiffness=7.0, priority=2)
    law = Law(tasks=(com, low, legs))
    assert law.levels(ROBOT) == [0, 2, 2 + 3 + ROBOT.n]
    expected = np.diag([0.0, 0.0, 1.0, 2.0, 3.0, *[7.0] * ROBOT.n])
    expected[:2, :2] = [[5.0, 1.0], [1.0, 4.0]]
    np.testing.assert_array_equal(law.gain(ROBOT), expected)
    other = replace(law, tasks=(replace(com, priority=1), low, legs))
    assert other.levels(ROBOT) == [0, 5, 5 + ROBOT.n]
    assert not np.array_equal(other.gain(ROBOT), expected)


def test_words_are_taken_for_what_they_mean_and_others_refused():
    task = (posture("t"),)
    law = Law(tasks=task, gravity="planned", stiffness_form="force", task_inertia="lambda_star",
              task_error="plain")  # fmt: skip
    assert law.gravity is GravityCompensation.PLANNED
    assert law.stiffness_form is StiffnessForm.FORCE
    assert law.task_inertia is TaskInertia.LAMBDA_STAR
    assert law.task_error is TaskError.PLAIN
    for name in ("gravity", "stiffness_form", "task_inertia", "task_error"):
        with pytest.raises(ValueError, match="sometimes"):
            Law(tasks=task, **{name: "sometimes"})


def test_it_is_a_value():
    law = Law(tasks=(posture("t"),))
    assert law == replace(law)
    assert law != replace(law, signal=StaticJoint())
    with pytest.raises(FrozenInstanceError):
        law.signal = StaticJoint()


def test_where_it_rests():
    """Only q̄(θ) with compensation has no error in the posture though the springs carry gravity."""
    rests = {
        (name, gravity): Law(
            tasks=(posture("t"),), signal=Signal.named(name), gravity=gravity
        ).rests_at_posture
        for name in Signal.names()
        for gravity in GravityCompensation
    }
    assert {key for key, yes in rests.items() if yes} == {
        ("static_joint", GravityCompensation.FEEDBACK),
        ("static_joint", GravityCompensation.PLANNED),
    }


def test_signals_have_the_words_of_project_files():
    kinds = [MotorAngles, LinkAngles, StaticJoint, Tank]
    assert [type(Signal.named(name)) for name in Signal.names()] == kinds
    assert [kind.name for kind in kinds] == list(Signal.names())
    with pytest.raises(UnknownNameError, match="static_joint_tank"):
        Signal.named("joints")


@pytest.mark.parametrize(
    ("signal", "wrong"),
    [
        (Tank, {"energy": -1.0}),
        (Tank, {"energy": np.nan}),
        (Tank, {"rate": np.inf}),
        (Tank, {"iterations": 0}),
        (StaticJoint, {"iterations": 0}),
    ],
)
def test_signals_refuse_what_cannot_be_run(signal, wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        signal(**wrong)
    signal(**dict.fromkeys(wrong, 1))


def test_bad_tasks_are_refused():
    with pytest.raises(InputError, match="needs a frame"):
        Task(name="t", kind=TaskKind.POSE, stiffness=np.array(1.0))
    with pytest.raises(InputError, match="at least one"):
        Law(tasks=())
    with pytest.raises(InputError, match="same name"):
        Law(tasks=(posture("t"), posture("t", priority=2)))
    task = Task(name="t", kind=TaskKind.POSE, frame="nose", stiffness=np.array(1.0))
    with pytest.raises(UnknownNameError, match="nose"):
        Law(tasks=(task,)).rows(ROBOT)
    wrong = Task(name="t", kind=TaskKind.COM, stiffness=np.array([1.0, 2.0]))
    with pytest.raises(InputError, match="shape"):
        wrong.gain(3)
    Law(tasks=(posture("t"), posture("u"))).rows(ROBOT)
