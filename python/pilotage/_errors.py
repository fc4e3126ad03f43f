"""Exceptions and warnings, with the command's words."""

from typing import Any


class Error(Exception):
    """What pilotage could not do.

    Attributes
    ----------
    message : str
        What is wrong, and where.
    hint : str or None
        What to do next.
    """

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message if hint is None else f"{message}\nhint: {hint}")
        self.message = message
        self.hint = hint

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.message, self.hint)


class InputError(Error, ValueError):
    """Arguments or files that cannot be used: where the command's exit code is 2."""


class FmuError(Error, RuntimeError):
    """An FMU failed, crashed, hung or discarded a step.

    Attributes
    ----------
    result : Result or None
        The rows until then.
    """

    result: Any = None


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped a call.

    Attributes
    ----------
    result : object or None
        What the call had: the best fit so far, the rows so far. None if there was nothing within 0.2 s.
    """

    result: Any = None


class PilotageWarning(UserWarning):
    """What pilotage doubts."""
