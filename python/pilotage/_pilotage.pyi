"""The native part: crates/python."""

from collections.abc import Callable
from os import PathLike
from typing import final

_Path = str | PathLike[str]
_Array = tuple[str, str, bytearray]
_Table = tuple[bytearray, list[_Array]]
_Left = tuple[int, str, str, list[tuple[str, _Table]], list[tuple[str, str]]]

__all__ = ["Prepared", "call", "hosted", "main", "read_table", "version", "write_table"]

def hosted(python: _Path, before: list[str], name: str) -> None:
    """How the command is started in a process of its own."""

def main(python: _Path, before: list[str], words: list[str]) -> None:
    """Runs the command in this process, which it ends with its exit code."""

def call(
    words: list[str], progress: Callable[[int, int], object] | None = None, folder: _Path | None = None
) -> _Left:
    """Runs the command in a thread of its own; gives exit code, stdout, stderr, tables and texts."""

def version() -> str:
    """The version of pilotage."""

def write_table(
    path: _Path, comments: list[str], time: bytes, columns: list[tuple[str, str, bytes]]
) -> None:
    """Writes a table over time as CSV."""

def read_table(path: _Path) -> tuple[list[str], _Table]:
    """Reads a table over time."""

@final
class Prepared:
    """A system that is opened once and simulated any number of times."""

    def __new__(cls, words: list[str]) -> Prepared: ...
    def run(
        self, settings: list[tuple[str, str]], progress: Callable[[int, int], object] | None = None
    ) -> _Left:
        """Simulates with other values of these variables."""
