"""Calls of the command: words from arguments, exceptions and warnings from what it says."""

from __future__ import annotations

import json
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from . import _command, _pilotage
from ._errors import Error, FmuError, InputError, Interrupted, PilotageWarning

if TYPE_CHECKING:
    from ._tables import Table

_pilotage.hosted(sys.executable, _command.before("pilotage"), "pilotage")

# Prefix of folders for arrays and texts.
FOLDER = "pilotage-python-"

PathLike = str | os.PathLike[str]
# How a long call shows how far it is: a bar of tqdm, or a function of what is done and what there is.
Progress = bool | Callable[[int, int], object]


@dataclass
class Left:
    """What a command left."""

    code: int
    stdout: str
    error: str | None
    hint: str | None
    notes: list[str] = field(default_factory=list)
    tables: dict[str, Table] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)

    def json(self) -> Any:
        """The object that it printed."""
        return json.loads(self.stdout)


def words(*positional: object, **flags: object) -> list[str]:
    """Words of the command line. None and False leave a flag out, True needs no value, a list repeats it."""
    found: list[str] = []
    for name, value in flags.items():
        flag = "--" + name.strip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            found.append(flag)
            continue
        values = value if isinstance(value, list) else [value]
        found += [f"{flag}={text(one)}" for one in values]
    # A path that begins with a dash is one all the same.
    given = map(text, positional)
    return found + [f"./{own}" if own.startswith("-") else own for own in given]


def text(value: object) -> str:
    """A value as the command reads it; numbers with all their digits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if isinstance(value, os.PathLike):
        return os.fsdecode(value)
    if isinstance(value, int):
        return str(value)
    try:
        return repr(float(value))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return str(value)


def pairs(values: Mapping[str, object] | None) -> list[str]:
    """`name=value` for each."""
    return [f"{name}={text(value)}" for name, value in (values or {}).items()]


def call(
    command: str,
    arguments: Iterable[str],
    finish: Callable[[Left], Any] | None = None,
    accepted: tuple[int, ...] = (0, 1),
    progress: Progress = False,
) -> Left:
    """Runs a command.

    Parameters
    ----------
    command : str
        Its name, with that of a subcommand.
    arguments : iterable of str
        Its words.
    finish : callable, optional
        Makes of what is left what `Interrupted` has as its result.
    accepted : tuple of int
        Exit codes with an answer, if the command printed one.
    progress : bool or callable
        Shows how far it is.

    Returns
    -------
    Left

    Raises
    ------
    InputError, FmuError, Error, Interrupted
    """
    all_words = [*command.split(), *arguments]
    with following(progress) as told:
        return listen(lambda: _pilotage.call(all_words, told), finish, accepted)


@contextmanager
def following(progress: Progress) -> Iterator[Callable[[int, int], object] | None]:
    """What is called with what is done and what there is."""
    if callable(progress):
        yield progress
    elif not progress:
        yield None
    else:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            hint = "install tqdm, or give a function of what is done and what there is"
            raise InputError("progress=True draws a bar of tqdm, which is not installed", hint) from None
        with tqdm() as bar:

            def told(done: int, total: int) -> None:
                bar.total = total
                bar.update(done - bar.n)

            yield told


def listen(
    run: Callable[[], _pilotage._Left],
    finish: Callable[[Left], Any] | None = None,
    accepted: tuple[int, ...] = (0, 1),
) -> Left:
    """Runs native code, and raises and warns as it says."""
    try:
        left = taken(run())
    except KeyboardInterrupt as interrupt:
        stopped = Interrupted("stopped by Ctrl-C")
        got = getattr(interrupt, "left", None)
        if got is not None and finish is not None:
            left = taken(got)
            if left.code in accepted and left.error is None:
                stopped.result = finish(left)
        raise stopped from None
    if left.code not in accepted or not (left.stdout or left.error is None):
        raise failure(left)
    return left


def failure(left: Left) -> Error:
    """The exception for a command that failed."""
    message = left.error or left.stdout.strip() or f"the command ended with {left.code}"
    match left.code:
        case 2:
            return InputError(message, left.hint)
        case _:
            return FmuError(message, left.hint)


def taken(left: _pilotage._Left) -> Left:
    """What native code left; its warnings are Python's."""
    from ._tables import Table

    code, stdout, stderr, tables, texts = left
    said = Said(cleaned(stderr))
    for warning in said.warnings:
        warnings.warn(warning, PilotageWarning, stacklevel=level())
    named = {name: Table.of(native) for name, native in tables}
    known = {name: cleaned(own) for name, own in texts}
    return Left(code, cleaned(stdout), said.error, said.hint, said.notes, named, known)


def cleaned(text: str) -> str:
    """Without the temporary folder in which arrays and texts stand, of which nobody knows."""
    return re.sub(rf"[^\s`\"']*{FOLDER}\w+/", "", text) if FOLDER in text else text


class Said:
    """The lines of stderr by their labels; lines without one belong to the error before them."""

    def __init__(self, stderr: str) -> None:
        lines: dict[str, list[str]] = {"error": [], "hint": [], "warning": [], "note": []}
        label = None
        for line in stderr.splitlines():
            head, _, rest = line.partition(": ")
            if head in lines and rest:
                label = head
                lines[label].append(rest)
            elif label in ("error", "hint"):
                lines["error"][-1:] = ["\n".join([*lines["error"][-1:], line])]
            else:
                label = None
        self.error = "\n".join(lines["error"]).strip() or None
        self.hint = "\n".join(lines["hint"]) or None
        self.warnings = lines["warning"]
        self.notes = lines["note"]


def level() -> int:
    """How far above the caller's code stands: the first frame outside of this package."""
    own = os.path.dirname(__file__)
    depth, frame = 1, sys._getframe(1)
    while frame.f_back is not None and os.path.dirname(frame.f_code.co_filename) == own:
        depth, frame = depth + 1, frame.f_back
    return depth
