"""The command line `sealag`."""

from sealag.cli._app import main

__all__ = ["main"]
