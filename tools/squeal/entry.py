"""Entry points of the installed package: tools as commands of their own, squeal-plot and others."""

from collections.abc import Callable
from importlib import import_module

from squeal.common import tool


def _command(name: str) -> Callable[[], None]:
    """A function that runs the main function of a tool; its errors are sentences."""
    return lambda: tool(import_module(f"squeal.commands.{name}").main)


plot, report, mesh, matrices, sound, uff = map(_command, ("plot", "report", "mesh", "matrices", "sound", "uff"))
