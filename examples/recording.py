"""Record an own signal beside a walk's joint states, and read both back from the MCAP file."""

import tempfile
from pathlib import Path

import sealag
from sealag.report import McapRecorder, read_recording

system = sealag.load("bundled:hume")
run = sealag.simulate(system, scenario="walk", duration=0.2)
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "walk.mcap"
    with McapRecorder(path=path, joints=run.joints) as recorder:
        recorder.write_joint_states(run.time, run.theta, run.theta_dot, effort=run.tau_sea)
        power = run.tau_sea * run.theta_dot
        recorder.write_signal("/spring_power", run.joints, run.time, values=power)
    for topic, signal in read_recording(path).signals.items():
        print(f"{topic:16} {signal.values.shape[0]} instants, {', '.join(signal.names[:3])}, …")
