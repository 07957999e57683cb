"""Exceptions: where, why, and what to do."""

from __future__ import annotations

import sys
import warnings


class Error(Exception):
    """Whatever tessuto refuses or fails at.

    Attributes:
        place: File, array, frame or stage; empty where there is none.
        cause: What is wrong, with the value found.
        remedy: What to do about it.
        exit_code: The program's exit status for such an error, see docs/exit-codes.md.
    """

    exit_code: int = 101

    def __init__(self, place: str = "", cause: str = "", remedy: str = "") -> None:
        super().__init__(place, cause, remedy)
        self.place = place
        self.cause = cause
        self.remedy = remedy

    def __str__(self) -> str:
        where = f"{self.place}: " if self.place else ""
        remedy = f"\n  hint: {self.remedy}" if self.remedy else ""
        return f"{where}{self.cause}{remedy}"


class UsageError(Error, ValueError):
    """A wrong argument or setting, found before the work."""

    exit_code = 2


class InputError(Error, ValueError):
    """A file, array or folder that cannot be used."""

    exit_code = 3


class NumericalError(Error, ArithmeticError):
    """The computation left the finite numbers or cannot go on."""

    exit_code = 4


class OutputError(Error):
    """A file that cannot be written."""

    exit_code = 5


class ProcessorError(Error, ImportError):
    """A processor that lacks the instructions of this build."""

    exit_code = 6


class InterruptedError(Error):
    """The work was ended before its end."""

    exit_code = 75


class SceneWarning(UserWarning):
    """Something doubtful about a scene or a result that does not stand in the way."""


def warn(text: str) -> None:
    """Warn at the line outside of this package that led here, however deep it lies below it."""
    package = __name__.split(".", maxsplit=1)[0]
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".", maxsplit=1)[0] == package:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, SceneWarning, stacklevel=level)
