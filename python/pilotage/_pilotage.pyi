"""The native part: crates/python."""

from os import PathLike
from typing import final

Path = str | PathLike[str]
Array = tuple[str, str, bytearray]
Table = tuple[bytearray, list[Array]]
Left = tuple[int, str, str, list[tuple[str, Table]], list[tuple[str, str]]]

def hosted(python: Path, before: list[str], name: str) -> None:
    """How the command is started in a process of its own."""

def main(python: Path, before: list[str], words: list[str]) -> None:
    """Runs the command in this process, which it ends with its exit code."""

def call(words: list[str]) -> Left:
    """Runs the command in a thread of its own; gives exit code, stdout, stderr, tables and texts."""

def version() -> str:
    """The version of pilotage."""

def write_table(
    path: Path, comments: list[str], time: bytes, columns: list[tuple[str, str, bytes]]
) -> None:
    """Writes a table over time as CSV."""

def read_table(path: Path) -> tuple[list[str], Table]:
    """Reads a table over time."""

@final
class Prepared:
    """A system that is opened once and simulated any number of times."""

    def __new__(cls, words: list[str]) -> Prepared: ...
    def run(self, settings: list[tuple[str, str]]) -> Left:
        """Simulates with other values of these variables."""
