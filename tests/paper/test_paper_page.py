"""The page is self-contained and says what was computed."""

import re
import shutil
from contextlib import contextmanager
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from humanoids2016 import (
    QUICK,
    AblationTable,
    delayed_margin,
    planned_walk,
    simulate_walk,
    study,
    write_paper_page,
)
from sealag.design import load
from sealag.passivity import Instant, Problem, max_delay, solve

pytestmark = pytest.mark.slow


class Links(HTMLParser):
    def __init__(self):
        super().__init__()
        self.outside, self.anchors, self.tables, self.ids = [], [], [], []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.ids += [found["id"]] if "id" in found else []
        for key in ("src", "href"):
            target = found.get(key) or ""
            if target.startswith("#"):
                self.anchors.append(target[1:])
            elif target.startswith("tables/"):
                self.tables.append(target)
            elif target and tag != "use":
                self.outside.append(target)


HUME = load("bundled:hume").files[0]
WALK = {
    "steps = 7": "steps = 3",
    "apex_speed = 0.5 ": "apex_speed = 0.45 ",
    'terrain = { kind = "paper" }': 'terrain = { kind = "flat" }',
}
"""What the page's project walks otherwise than the bundled one."""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A page from few cases, and what went into it."""
    out = tmp_path_factory.mktemp("page")
    project = tmp_path_factory.mktemp("project") / "hume.toml"
    text = HUME.read_text()
    for before, after in WALK.items():
        assert text.count(before) == 1
        text = text.replace(before, after)
    project.write_text(text)
    found = study(str(project), QUICK, progress=lambda _: None)
    everywhere = AblationTable(
        means=("everything", "no lead"), conditions=("K = 200", "α = 2", "no delay"), terrains=7,
        walked=np.array([[7, 6, 5], [4, 3, 2]]), gaits=np.array([[6, 5, 4], [1, 1, 0]]),
    )  # fmt: skip
    printed = replace(found.ablations[0], name="published law", walked=0, mean_steps=1.25)
    found = replace(found, everywhere=everywhere, ablations=(found.ablations[0], printed))
    return SimpleNamespace(found=found, page=write_paper_page(out, found, version="test"))


def test_page_needs_no_network_and_holds_the_numbers(written):
    found, out = written.found, written.page.parent
    figure, delays, certificate = found.figure, found.delays, found.certificate
    walk, traces = found.walk, found.traces
    text = written.page.read_text()
    links = Links()
    links.feed(text)
    assert links.outside == []
    assert set(links.anchors) >= {
        "claims", "loop", "criteria", "live", "figure4", "certified", "levels", "unsafe", "ports",
        "left-out", "walk",
        "means", "energy", "limits", "figure5", "beyond", "assumptions", "rows",
    }  # fmt: skip
    assert set(links.anchors) <= set(links.ids)
    assert len(links.ids) == len(set(links.ids))
    assert len(links.tables) == text.count("<table")
    assert all((out / target).is_file() for target in links.tables)
    assert 'name="viewport"' in text
    assert not re.search(r"https?://(?!www\.w3\.org|purl\.org|creativecommons|matplotlib)", text)
    assert text.count("<svg") >= 3
    assert "<canvas" in text
    assert f"{delays.first_crossing[0] * 1e3:.1f}" in text
    assert f"{certificate.answer.time_varying_delay_s * 1e3:.2f} ms" in text
    assert [cell in text for cell in (">7 / 6<", ">3 / 1<", ">2 / 0<")] == [True] * 3
    assert f"{walk.run.audit.closure:.1e}" in text
    assert delays.walked.tolist() == [[1, 0]]  # the paper's delays, and six times as long ones
    assert f"{figure.delay_s[1][3] * 1e3:.1f}" in text
    assert "published law: 0 of 1 walk, 1.2 steps in the mean" in text
    assert "T_H of 20 ms in the mean and 30 ms at most" in text
    tables = {path.stem: path.read_text() for path in (out / "tables").iterdir()}
    assert text.count("<table") == len(tables)
    assert "no lead,4 / 1,3 / 1,2 / 0" in tables["means_3"]
    torques = np.genfromtxt(out / "figure5.csv", delimiter=",", names=True)
    expected = traces[-1].achieved[::2][-1, 0]
    assert torques[f"spring_{walk.run.joints[0]}_nm"][-1] == pytest.approx(expected, rel=1e-8)
    csv = np.genfromtxt(out / "figure4.csv", delimiter=",", names=True)
    np.testing.assert_allclose(csv["one_leg_delay_s_D10"], figure.delay_s[1], rtol=1e-8)
    assert len((out / "figure4_instants.csv").read_text().splitlines()) == len(found.motion) + 1


def test_the_page_shows_the_projects_own_walk(written):
    """Feet, ground, gait and steps of [walking]; the bundled project walks otherwise."""
    found, text = written.found, written.page.read_text()
    walking, bundled = found.system.walking, load("bundled:hume")
    assert "planned 3-step walk" in text
    assert "the planned 0.45 m/s" in text
    assert "the planned 0.5 m/s" not in text
    assert found.walk.case.walking == walking
    assert {row.steps for row in (*found.robust, *found.ablations, *found.gains)} == {3}
    assert found.walk.gait.place[:, 2] == pytest.approx(walking.gait.foot_radius, abs=1e-3)
    again = simulate_walk(found.system)
    np.testing.assert_array_equal(again.run.q, found.walk.run.q)
    theirs = simulate_walk(bundled)
    assert len(theirs.run.time) > len(again.run.time)
    assert np.abs(theirs.run.q[: len(again.run.time)] - again.run.q).max() > 1e-2
    assert len(planned_walk(bundled, rate=QUICK.rate)) > len(found.motion)


BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
in_browser = pytest.mark.skipif(
    BROWSER is None, reason="no Chromium on this machine; .ci/run installs one"
)


@contextmanager
def opened(written, width=1280, height=900, scheme="light", motion="no-preference"):
    """The page in a browser; what the browser complains about fails the test."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=BROWSER, args=["--no-sandbox", "--disable-background-networking"]
        )
        page = browser.new_page(
            viewport={"width": width, "height": height}, color_scheme=scheme, reduced_motion=motion
        )
        problems = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
        page.goto(written.page.as_uri())
        yield page
        assert problems == []
        browser.close()


PICTURE = "document.querySelector('canvas').toDataURL()"


@in_browser
@pytest.mark.parametrize(("width", "height"), [(1400, 900), (820, 1100), (390, 844)])
def test_page_in_a_browser(written, width, height):
    with opened(written, width, height) as page:
        first = page.evaluate(PICTURE)
        page.wait_for_function(f"{PICTURE} !== '{first}'", timeout=10_000)  # the walk is playing
        overflow = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert page.evaluate(overflow) <= 0
        page.evaluate("document.querySelector('h1').style.width = '200vw'")
        assert page.evaluate(overflow) > 0  # and a page that is too wide is noticed


@in_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_accessibility_checker_finds_nothing_serious(written, scheme):
    from axe_playwright_python.sync_playwright import Axe

    def serious(page):
        found = Axe().run(page).response["violations"]
        return {v["id"] for v in found if v["impact"] in ("serious", "critical")}

    with opened(written, scheme=scheme) as page:
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        assert serious(page) == set()
        page.evaluate(
            "document.querySelectorAll('label').forEach(l => l.replaceWith(...l.children))"
        )
        assert "label" in serious(page)  # sliders without a name are noticed


@in_browser
def test_reader_who_wants_no_motion_gets_none_and_has_the_keyboard(written):
    with opened(written, motion="reduce") as page:
        first = page.evaluate(PICTURE)
        page.wait_for_timeout(400)
        assert page.evaluate(PICTURE) == first
        page.focus(".playback canvas")
        page.keyboard.press("ArrowRight")
        assert page.evaluate(PICTURE) != first
        assert "ms" in page.inner_text(".playback .readout")


@in_browser
def test_browser_computes_what_sealag_computes(written):
    """The page's own bounds and margin, all over its sliders, against the library's."""
    leg, rng = written.found.live, np.random.default_rng(20161115)
    with opened(written) as page:
        for case in range(12):
            choice = {
                "alpha": float(rng.uniform(0.25, 5.0)), "damping": float(rng.uniform(5.0, 20.0)),
                "position": float(rng.uniform(10.0, 400.0)),
                "orientation": float(rng.uniform(5.0, 400.0)),
                "spring": float(10.0 ** rng.uniform(2.0, 3.7)),
                "beta": float(rng.uniform(0.1, 2.0)),
                "instant": int(rng.integers(len(leg.time))),
            }  # fmt: skip
            theirs = page.evaluate("choice => sealagLive.bounds(choice)", choice)
            expected = library_bounds(leg, choice)
            for name, value in expected.items():
                if value is None:
                    assert theirs[name] is None, (case, name)
                else:
                    assert theirs[name] == pytest.approx(value, rel=1e-6), (case, name, choice)


def library_bounds(leg, choice):
    k = choice["instant"]
    J, Lambda = leg.J_star[k], leg.Lambda[k]
    K_x = np.repeat([choice["position"], choice["orientation"]], 3)
    D = choice["alpha"] * np.append(choice["damping"], leg.motor_damping[1:])
    values, V = np.linalg.eigh(Lambda)
    root = (V * np.sqrt(np.clip(values, 0.0, None))) @ V.T
    F = J.T @ root @ np.diag(K_x) @ root @ J
    K = np.full(3, choice["spring"])
    static = None
    if np.linalg.eigvalsh(F)[-1] < choice["spring"]:
        K_theta = F @ np.linalg.inv(np.eye(3) - F / choice["spring"])
        problem = Problem.of_stiffness((K_theta + K_theta.T) / 2.0, D)
        static = float(solve(problem, share=Instant(tolerance=1e-9)).delay)
    margin = delayed_margin(leg.mass[k], K, choice["beta"] * leg.rotor_inertia, D=D, F=F)
    return {
        "published": float(max_delay(J, Lambda, K_x, D, form="published", tolerance=1e-9).delay),
        "certified": float(max_delay(J, Lambda, K_x, D, tolerance=1e-9).delay),
        "certifiedStatic": static,
        "margin": margin.delay,
    }
