"""Rows of a sweep: what the commands say of a file with these values, wherever it is computed."""

import copy
import math
import os
import shutil
import subprocess
import sys

import pytest

import sealag
from helpers.source import ROOT
from helpers.toml import to_toml
from helpers.two_joints import PROJECT, two_joints
from sealag.design import System
from sealag.errors import FileError, InputError
from sealag.sweep import Sweep

pandas = pytest.importorskip("pandas")

HAND = "tasks.hand.stiffness"
DELAY = "delays.central_round_trip.value_ms"
GRID = (f"{HAND}=20,80", f"{DELAY}=4,400")


@pytest.fixture
def project(tmp_path):
    return two_joints(tmp_path)


def rows_of(sweep, folder, **choices):
    sweep.run(folder, **choices)
    return pandas.read_parquet(folder)


def edited(project, stiffness, delay):
    """The design of the project with these values, written without TOML Kit."""
    data = copy.deepcopy(PROJECT)
    data["tasks"][0]["stiffness"] = stiffness
    data["delays"]["central_round_trip"]["value_ms"] = delay
    path = project.with_name("edited.toml")
    path.write_text(to_toml(data))
    return sealag.load(path)


def same_as_certify(row, system, motion=None):
    answer = sealag.certify(system, motion).confirmed().answer
    told = {
        "status": answer.status.value,
        "delay_s": system.delays.d_1,
        "reasons": "; ".join(answer.reasons),
        "worst_instant": answer.worst.instant,
        "worst_time_s": answer.worst.time_s,
        "limiting_joint": max(answer.worst.direction, key=answer.worst.direction.get),
    }
    names = ("max_delay_s", "local_margin_s", "first_crossing_s", "stable", "unstable_modes")
    told |= {name: getattr(answer, name) for name in names}
    assert {name: row[name] for name in told} == told
    assert row["error"] is None or pandas.isna(row["error"])


def test_certificates_are_those_of_edited_files(project, tmp_path):
    rows = rows_of(Sweep.of(project, GRID), tmp_path / "o", jobs=1)
    assert rows["point"].tolist() == [0, 1, 2, 3]
    for row in rows.to_dict("records"):
        same_as_certify(row, edited(project, row[HAND], row[DELAY]))
    assert rows["delay_s"].tolist() == pytest.approx([0.006, 0.402, 0.006, 0.402], abs=2e-3)
    assert set(rows["status"]) == {"certified", "not_certified"}


def test_designs_that_differ_in_delays_share_what_is_computed(project, tmp_path, monkeypatch):
    """Along a motion: bounds, proofs and loops once for each stiffness, with the rows of each."""
    path = tmp_path / "motion.csv"
    path.write_text("time_s,j1,j2\n0,0.4,0.5\n0.1,0.42,0.5\n0.2,0.45,0.52\n")
    calls = []
    sweep = Sweep.of(project, (f"{DELAY}=1,4,80,1000", f"{HAND}=20,80,5000"), motion=path)
    with monkeypatch.context() as counted:
        findings = System.findings
        counted.setattr(System, "findings", lambda *of: calls.append(of) or findings(*of))
        rows = rows_of(sweep, tmp_path / "o", jobs=1)
    assert len(calls) == 3
    assert rows[[HAND, DELAY]].values.tolist() == [
        [stiffness, delay] for stiffness in (20, 80, 5000) for delay in (1, 4, 80, 1000)
    ]
    for row in rows.to_dict("records"):
        same_as_certify(row, edited(project, row[HAND], row[DELAY]), path)
    assert len(set(rows["status"])) > 1
    bounds = rows_of(
        Sweep.of(project, (f"{DELAY}=1,4,80,1000", f"{HAND}=20,80,5000"), motion=path, ask="bound"),
        tmp_path / "b", jobs=1,
    )  # fmt: skip
    same = ["max_delay_s", "delay_s", "limiting_joint", "worst_instant", "worst_time_s"]
    pandas.testing.assert_frame_equal(bounds[same], rows[same], check_exact=True)
    assert bounds["passive"].tolist() == (rows["max_delay_s"] >= rows["delay_s"]).tolist()
    margins = rows_of(
        Sweep.of(project, (f"{DELAY}=1,4", f"{HAND}=20,80"), motion=path, ask="margin"),
        tmp_path / "m", jobs=1,
    )  # fmt: skip
    for row in margins.to_dict("records"):
        found = edited(project, row[HAND], row[DELAY]).local_margins(path)
        told = {"delay_s": found.delay_s, "jitter_s": found.jitter_s, "time_s": found.time_s}
        assert {name: row[name] for name in told} == told


def test_late_torque_feedback_is_not_shared(project, tmp_path):
    """A delay that is in the loop itself besides d_1: its answers are computed for each value."""
    over = (
        "delays.delayed_torque_feedback=false,true",
        "delays.embedded_round_trip.value_ms=1,6",
        f"{DELAY}=4,9",
    )
    rows = rows_of(Sweep.of(project, over), tmp_path / "o", jobs=1)
    alone = [
        rows_of(
            Sweep.of(project, [f"{key}={str(row[key]).lower()}" for key in rows.columns[1:4]]),
            tmp_path / str(row["point"]), jobs=1,
        ).drop(columns="point").to_dict("records")[0]
        for row in rows.to_dict("records")
    ]  # fmt: skip
    pandas.testing.assert_frame_equal(
        rows.drop(columns="point"), pandas.DataFrame(alone), check_exact=True, check_dtype=False
    )
    assert len(set(rows["local_margin_s"])) == 3


def test_margins_and_runs_are_those_of_edited_files(project, tmp_path):
    over = (f"{HAND}=20,80", f"{DELAY}=4", "simulation.duration_s=0.05")
    rows = rows_of(Sweep.of(project, over, ask="margin"), tmp_path / "m", jobs=1)
    runs = rows_of(Sweep.of(project, over, ask="simulate"), tmp_path / "s", jobs=1)
    for row, run in zip(rows.to_dict("records"), runs.to_dict("records"), strict=True):
        system = edited(project, row[HAND], row[DELAY])
        found = system.local_margins()
        assert (row["delay_s"], row["jitter_s"]) == (found.delay_s, found.jitter_s)
        told = sealag.simulate(system, duration=0.05)
        assert (run["outcome"], run["fell"]) == (told.outcome, False)
        moved = told.q - system.posture
        assert run["deviation_rms"] == pytest.approx(math.sqrt((moved**2).mean()), rel=1e-9)


def test_tuned_gains_are_those_of_the_project(project, tmp_path):
    from sealag.tune import tune

    rows = rows_of(
        Sweep.of(project, [f"{DELAY}=4,40"], ask="tune:safety=1.5"), tmp_path / "t", jobs=1
    )
    for row in rows.to_dict("records"):
        tuned = tune(edited(project, 40.0, row[DELAY]), safety=1.5)
        assert (row["found"], row["scale"]) == (tuned.found, tuned.scale)
        assert row["required_s"] == tuned.question.required


def test_processes_give_the_same_bytes(project, tmp_path):
    sweep = Sweep.of(project, GRID)
    sweep.run(tmp_path / "a", jobs=1)
    sweep.run(tmp_path / "b", jobs=2)
    assert content(tmp_path / "a") == content(tmp_path / "b")


def content(folder):
    return {path.name: path.read_bytes() for path in folder.glob("part-*")}


@pytest.mark.slow
def test_a_cluster_of_two_workers_gives_the_same_bytes(project, tmp_path):
    distributed = pytest.importorskip("distributed")
    sweep = Sweep.of(project, (f"{HAND}=10:80:lin5", f"{DELAY}=4,400"))
    sweep.run(tmp_path / "a", jobs=1)
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**settings, local_directory=str(tmp_path)) as cluster:
        told = sweep.run(tmp_path / "b", scheduler=cluster.scheduler_address)
    assert (told.points, told.computed) == (10, 10)
    assert content(tmp_path / "a") == content(tmp_path / "b")


def test_no_scheduler_is_one_sentence(project, tmp_path, monkeypatch):
    sweep = Sweep.of(project, GRID)
    with pytest.raises(InputError, match="does not go with"):
        sweep.run(tmp_path / "o", jobs=2, scheduler="tcp://127.0.0.1:9")
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", None)  # its remains would print a traceback
    for address in ("foo", "tcp://127.0.0.1", "http://10.0.0.1:8786", "tcp://127.0.0.1:x"):
        with pytest.raises(InputError, match="no scheduler answers there"):
            sweep.run(tmp_path / "o", scheduler=address)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="needs the package distributed"):
        sweep.run(tmp_path / "o", scheduler="tcp://127.0.0.1:9")


def test_a_refused_point_is_a_row_with_its_reason(project, tmp_path):
    told = Sweep.of(project, [f"{HAND}=-1,20"]).run(tmp_path / "o", jobs=1)
    rows = pandas.read_parquet(tmp_path / "o")
    assert (told.points, told.refused, told.failed) == (2, 1, 0)
    assert rows["error_kind"][0] == "ProjectError"
    assert "-1" in rows["error"][0]
    assert str(tmp_path) not in rows["error"][0]
    assert pandas.isna(rows["max_delay_s"][0])
    assert rows["max_delay_s"][1] > 0.0


def test_a_second_run_computes_nothing(project, tmp_path):
    sweep = Sweep.of(project, GRID)
    assert sweep.run(tmp_path / "o", jobs=1).computed == 4
    before = content(tmp_path / "o")
    assert sweep.run(tmp_path / "o", jobs=1).computed == 0
    (tmp_path / "o" / "part-00000001.parquet").unlink()
    assert sweep.run(tmp_path / "o", jobs=1).computed == 2
    assert content(tmp_path / "o") == before


def test_another_sweep_s_folder_is_refused(project, tmp_path):
    Sweep.of(project, GRID).run(tmp_path / "o", jobs=1)
    before = content(tmp_path / "o")
    with pytest.raises(FileError, match="differs in its question"):
        Sweep.of(project, GRID, ask="margin").run(tmp_path / "o", jobs=1)
    with pytest.raises(FileError, match="differs in its keys"):
        Sweep.of(project, (GRID[0], f"{DELAY}=4,401")).run(tmp_path / "o", jobs=1)
    project.write_text(project.read_text() + "\n# another\n")
    with pytest.raises(FileError, match="differs in its files"):
        Sweep.of(project, GRID).run(tmp_path / "o", jobs=1)
    assert content(tmp_path / "o") == before
    with pytest.raises(FileError, match="holds other files"):
        Sweep.of(project, GRID).run(tmp_path, jobs=1)


def test_parts_that_are_not_this_sweep_s_are_refused(project, tmp_path):
    sweep = Sweep.of(project, GRID)
    sweep.run(tmp_path / "o", jobs=1)
    Sweep.of(project, (GRID[0], f"{DELAY}=4,401")).run(tmp_path / "other", jobs=1)
    part = tmp_path / "o" / "part-00000001.parquet"
    shutil.copy(tmp_path / "other" / part.name, part)
    with pytest.raises(FileError, match="is of another sweep"):
        sweep.run(tmp_path / "o", jobs=1)
    part.write_bytes(part.read_bytes()[:100])
    with pytest.raises(FileError, match="is damaged"):
        sweep.run(tmp_path / "o", jobs=1)


def test_a_file_that_changes_meanwhile_ends_the_sweep(project, tmp_path):
    sweep = Sweep.of(project, GRID)
    urdf = project.with_name("two.urdf")
    urdf.write_text(urdf.read_text().replace('mass value="2"', 'mass value="3"'))
    with pytest.raises(FileError, match="not here what it was"):
        sweep.run(tmp_path / "o", jobs=1)
    assert content(tmp_path / "o") == {}


@pytest.mark.slow
def test_memory_does_not_grow_with_the_points(project, tmp_path):
    """Points that are refused at once: a hundred times as many take less than 12 MB more."""
    ask = (
        "import resource, sys; from pathlib import Path; from sealag.sweep import Sweep\n"
        "over = ['tasks.hand.stiffness=-2:0.0001:lin' + sys.argv[2]]\n"
        "told = Sweep.of(sys.argv[1], over).run(Path(sys.argv[3]), jobs=1)\n"
        "assert told.points == int(sys.argv[2])\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)"
    )

    def peak(points):
        command = [sys.executable, "-c", ask, project, str(points), tmp_path / str(points)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        return int(subprocess.run(command, env=environment, capture_output=True, check=True).stdout)

    assert peak(10_000) < peak(100) + 12e6
