"""Packages that sealag can hand its answers to, and does not need."""

from importlib import import_module
from typing import Any

from sealag.errors import InputError


def extra(name: str, *, use: str) -> Any:
    """Import a package that is optional.

    Args:
        name: of the package, of its module and of sealag's extra.
        use: what it is needed for, such as "Run.to_pandas".

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise InputError(
            f"{use} needs the package {name}, which is not installed: pip install {name}."
        ) from error


__all__ = ["extra"]
