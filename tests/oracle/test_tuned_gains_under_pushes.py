"""Joint PD tuned for a delay holds a pushed Go2 under that delay and its jitter; a fifth more does
not. The judge is the simulated robot on its feet, sampled and late, which tuning does not run."""

import numpy as np
import pytest

import sealag
from helpers.source import ROOT
from sealag.tune import tune

pandas = pytest.importorskip("pandas")

PUSH = """
[[simulation.pushes]]
frame = "base"
force_n = [20.0, 10.0, 0.0]
start_s = 0.2
duration_s = 0.1
"""
SECONDS = 4


def go2(folder, delay_ms, period_ms, jitter_ms, kp):
    """Write the example with a delay that swings by ± jitter_ms and ends at delay_ms, hold
    included."""
    text = (ROOT / "examples" / "go2.toml").read_text()
    mean = delay_ms - period_ms - jitter_ms
    late = f'{{ kind = "sinusoid", mean_ms = {mean}, amplitude_ms = {jitter_ms} }}'
    for old, new in (
        ('{ kind = "constant", value_ms = 5.0 }', late),
        ("sample_time_ms = 2.0", f"sample_time_ms = {period_ms}"),
        ("kp = 40.0", f"kp = {kp!r}"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "go2.toml"
    path.write_text(text + PUSH)
    return path


def speeds(run):
    """Root mean square of the joints' speeds in each second, rad/s."""
    table = run.to_pandas()
    columns = [name for name in table.columns if name.endswith("_joint:velocity")]
    assert len(columns) == 12
    v = table[columns].to_numpy()[:-1].reshape(SECONDS, -1)
    return np.sqrt((v**2).mean(axis=1))


@pytest.mark.parametrize(
    ("delay_ms", "period_ms", "jitter_ms"), [(5.0, 0.5, 0.25), (10.0, 1.0, 0.5), (20.0, 1.0, 1.0)]
)
def test_tuned_gains_hold_and_a_fifth_more_does_not(delay_ms, period_ms, jitter_ms, tmp_path):
    project = go2(tmp_path, delay_ms, period_ms, jitter_ms, 40.0)
    found = tune(sealag.load(project), number="jitter")
    assert found.reached_s == pytest.approx(1e-3 * delay_ms, rel=1e-4)
    (kp,) = set(found.summary()["kp"].values())
    for factor in (1.0, 1.2):
        go2(tmp_path, delay_ms, period_ms, jitter_ms, factor * kp)
        run = sealag.simulate(project, scenario="regulate", duration=float(SECONDS))
        after_push, at_end = speeds(run)[[1, 3]]
        assert (at_end < after_push) if factor == 1.0 else (at_end > 1.5 * after_push)
