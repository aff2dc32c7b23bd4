"""Controllers that a project names as a Python function."""

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sealag.errors import FileError, InputError
from sealag.whole_body import TickController


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
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"{path} raises {type(error).__name__}: {error}.") from error
    make: Any = getattr(module, function, None)
    if not callable(make):
        raise InputError(f"{path} has no function {function}; controller.function names it.")

    def made(system: Any) -> TickController:
        try:
            controller: Any = make(system)
        except Exception as error:
            raise InputError(
                f"{function} of {path} raises {type(error).__name__}: {error}."
            ) from error
        for name in ("reset", "tick"):
            if not callable(getattr(controller, name, None)):
                raise InputError(
                    f"What {function} of {path} returns has no {name}; a controller has "
                    "reset(t, measurement) and tick(t, measurement, out)."
                )
        return controller

    return made
