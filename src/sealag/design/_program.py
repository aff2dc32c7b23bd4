"""Controllers that a project names as a Python function."""

import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sealag.errors import FileError, InputError, SealagError
from sealag.typing import Array
from sealag.whole_body import Measurement, TickController


@contextmanager
def _blamed(what: str) -> Iterator[None]:
    """Say whose error it is: what a program raises, also by leaving, is wrong input."""
    try:
        yield
    except SealagError:
        raise
    except (Exception, SystemExit) as error:
        said = f"{type(error).__name__}: {error}".rstrip(": .")
        raise InputError(f"{what} raises {said}.") from error


@dataclass(frozen=True, slots=True)
class _Ticking:
    """A program's controller whose errors name its file."""

    controller: TickController
    path: Path

    def reset(self, t: float, measurement: Measurement) -> None:
        """Pass on; see `TickController`."""
        with _blamed(f"reset in {self.path}"):
            self.controller.reset(t, measurement)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Pass on; see `TickController`."""
        with _blamed(f"tick in {self.path}"):
            self.controller.tick(t, measurement, out)

    def __getattr__(self, name: str) -> Any:
        """What else the controller states: theta, state_space, storage."""
        if name.startswith("__"):  # copies ask before the fields are there
            raise AttributeError(name)
        return getattr(object.__getattribute__(self, "controller"), name)


def program_of(path: Path, function: str) -> Callable[[Any], TickController]:
    """Run a file and return its function, checked: from a `System` to an object that ticks.

    Args:
        path: the Python file.
        function: the function's name.

    Raises:
        FileError: there is no such file.
        InputError: it raises an error, or has no such function.
    """
    if not path.is_file():
        raise FileError(f"there is no file {path}; controller.file is a path beside the project.")
    spec = importlib.util.spec_from_file_location(f"_sealag_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} is no Python file; its name must end in .py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses of the file look up their annotations
    with _blamed(str(path)):
        spec.loader.exec_module(module)
    make: Any = getattr(module, function, None)
    if not callable(make):
        raise InputError(f"{path} has no function {function}; controller.function names it.")

    def made(system: Any) -> TickController:
        with _blamed(f"{function} of {path}"):
            controller: Any = make(system)
        for name in ("reset", "tick"):
            if not callable(getattr(controller, name, None)):
                raise InputError(
                    f"What {function} of {path} returns has no {name}; a controller has "
                    "reset(t, measurement) and tick(t, measurement, out)."
                )
        return _Ticking(controller, path)

    return made
