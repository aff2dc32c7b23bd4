"""The page is self-contained and says what was computed."""

import re
from html.parser import HTMLParser

import numpy as np

from sealag.design import certify, load
from sealag.locomotion import paper_terrain, plan_walk, walk_motion
from sealag.paper import (
    AblationTable,
    DelayMap,
    WalkCase,
    delay_map,
    figure_4,
    figure_4_claims,
    figure_5,
    random_plant_table,
    simulate_walk,
    unsafe_examples,
    walk_success,
)
from sealag.report import (
    beyond_section,
    energy_section,
    figure_5_section,
    limits_section,
    means_section,
    walk_section,
    write_paper_page,
)


class Links(HTMLParser):
    def __init__(self):
        super().__init__()
        self.outside, self.anchors, self.ids = [], [], set()

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.ids.add(found.get("id"))
        for key in ("src", "href"):
            target = found.get(key) or ""
            if target.startswith("#"):
                self.anchors.append(target[1:])
            elif target and tag != "use":
                self.outside.append(target)


def test_page_needs_no_network_and_holds_the_numbers(tmp_path):
    system = load("bundled:hume")
    motion = walk_motion(system.robot, plan_walk(paper_terrain(), steps=1), rate=20.0)
    figure = figure_4(system.robot, motion, system=system)
    walk = simulate_walk(system, WalkCase(steps=2))
    rows = walk_success({"default": WalkCase(steps=1)}, [paper_terrain()])
    table = random_plant_table(30)
    delays = delay_map(motion, stiffnesses=[350.0], scales=[1.0, 6.0], terrains=1)
    everywhere = AblationTable(
        means=("everything", "no lead"), conditions=("K = 200", "α = 2", "no delay"), terrains=7,
        walked=np.array([[7, 6, 5], [4, 3, 2]]), gaits=np.array([[6, 5, 4], [1, 1, 0]]),
    )  # fmt: skip
    certificate = certify(system, motion, time_varying=True)
    traces = figure_5(betas=[0.5], jobs=2)
    extra = [
        walk_section(system.robot, walk, rows, rows),
        means_section(rows, everywhere, rows),
        energy_section(walk, certificate),
        limits_section(figure, figure, rows, delays),
        figure_5_section(traces, system.robot.joints),
        beyond_section(rows, certificate),
    ]
    page = write_paper_page(
        tmp_path, figure, figure_4_claims(figure, table), unsafe=unsafe_examples(draws=10),
        table=table, extra=extra, version="test",
    )  # fmt: skip
    text = page.read_text()
    links = Links()
    links.feed(text)
    assert links.outside == []
    assert set(links.anchors) >= {
        "claims", "figure4", "certified", "unsafe", "walk", "means", "energy", "limits", "figure5",
        "beyond",
    }  # fmt: skip
    assert set(links.anchors) - {a for a in links.anchors if a.startswith(("m", "p"))} <= links.ids
    assert 'name="viewport"' in text
    assert not re.search(r"https?://(?!www\.w3\.org|purl\.org|creativecommons|matplotlib)", text)
    assert text.count("<svg") >= 3
    assert "<canvas" in text
    assert f"{delays.first_crossing[0] * 1e3:.1f}" in text
    assert f"{certificate.time_varying_delay_s * 1e3:.2f} ms" in text
    assert [cell in text for cell in (">7 / 6<", ">3 / 1<", ">2 / 0<")] == [True] * 3
    assert f"{walk.run.audit.closure:.1e}" in text
    assert delays.walked.tolist() == [[1, 0]]  # the paper's delays, and six times as long ones
    assert f"{figure.delay_s[1][3] * 1e3:.1f}" in text
    csv = np.genfromtxt(tmp_path / "figure4.csv", delimiter=",", names=True)
    np.testing.assert_allclose(csv["one_leg_delay_s_D10"], figure.delay_s[1], rtol=1e-8)
    assert len((tmp_path / "figure4_instants.csv").read_text().splitlines()) == len(motion) + 1


def test_the_longest_delay_ends_at_the_first_fall():
    """Walking again beyond a fall does not count."""
    two = np.array([0.1, 0.2, 0.3, 0.4])
    delays = DelayMap(
        stiffness=np.array([1.0, 2.0]), scale=two, d_1=two, terrains=2,
        walked=np.array([[2, 2, 1, 2], [2, 2, 2, 2]]), gaits=np.array([[0, 2, 2, 2], [2, 2, 0, 0]]),
        certified_motor=two[:2], certified_static=two[:2], first_crossing=two[:2],
    )  # fmt: skip
    assert delays.longest_walked.tolist() == [0.2, 0.4]
    assert delays.longest_gait.tolist() == [0.0, 0.2]
