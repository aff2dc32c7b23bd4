"""Fixtures that several files share. Tests run in an empty folder: none depends on another one."""

import os
import tempfile
from collections.abc import Callable, Iterator

import pytest

from sealag.robot import Robot

Command = Callable[..., tuple[int, str, str]]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Leave the folder that pytest was started in before any test module is imported.

    Workers of pytest-xdist start where their controller is and look for tests from there, so that
    it stays.
    """
    workers = session.config.getoption("numprocesses", None)
    if not workers or hasattr(session.config, "workerinput"):
        os.chdir(tempfile.mkdtemp(prefix="sealag-tests-"))


@pytest.fixture(autouse=True)
def _empty_folder() -> Iterator[None]:
    """Come back to the session's own folder after a test that left it."""
    folder = os.getcwd()
    yield
    os.chdir(folder)


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Command:
    """The command line in this process: `cli("certify", path)` is its status, stdout and stderr."""
    from sealag.cli import main

    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([str(argument) for argument in arguments])
        return (int(stop.value.code or 0), *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def hume() -> Robot:
    """The bundled biped with a floating base."""
    from sealag.robot import load_robot

    return load_robot("bundled:hume.urdf", floating_base=True)
