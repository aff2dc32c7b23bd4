"""Importing is cheap: help and the package load none of the heavy libraries."""

import subprocess
import sys

import pytest

HEAVY = ("pinocchio", "numba", "cvxpy", "scipy", "matplotlib", "pydantic", "numpy")
SIMULATOR = ("sealag.simulation", "sealag.report")


def _loaded(code: str) -> set[str]:
    asked = HEAVY + SIMULATOR
    program = (
        f"import sys\n{code}\nprint('loaded:' + ','.join(m for m in {asked!r} if m in sys.modules))"
    )
    out = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    last = out.stdout.strip().splitlines()[-1]
    return set(last.removeprefix("loaded:").split(",")) - {""}


def test_help_imports_nothing_heavy() -> None:
    code = (
        "from sealag.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit as stop:\n    assert stop.code == 0\n"
    )
    assert _loaded(code) == set()


def test_package_imports_nothing_heavy() -> None:
    assert _loaded("import sealag") == set()


@pytest.mark.parametrize("room", ["passivity", "margin", "delay", "actuation", "design"])
def test_rooms_leave_compilers_and_plots_out(room: str) -> None:
    assert _loaded(f"import sealag.{room}") & {"numba", "cvxpy", "matplotlib"} == set()


def test_a_design_loads_no_simulator() -> None:
    assert _loaded("import sealag.design") & set(SIMULATOR) == set()
    assert set(SIMULATOR[:1]) <= _loaded("import sealag.simulation")


def test_check_sees_a_heavy_import() -> None:
    assert "numpy" in _loaded("import numpy")
