"""The command line `sealag`."""

from sealag.cli._main import main

__all__ = ["main"]
