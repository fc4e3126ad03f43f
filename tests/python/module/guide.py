"""Runs the code of README and of the notebooks, as a reader would; and docs/python.md says each name."""

import json
import os
import re
import shutil
import tempfile
from pathlib import Path
from textwrap import dedent

from common import FLIGHTS, ROOT

import pilotage as pl


def within_a_folder(snippets: list[str], name: str) -> dict[str, object]:
    """Runs them one after the other in a folder with the example flights; gives the names that they made."""
    names: dict[str, object] = {}
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("flights").mkdir()
        for flight in FLIGHTS:
            shutil.copy(flight, "flights")
        for number, snippet in enumerate(snippets, 1):
            exec(compile(snippet, f"{name}, snippet {number}", "exec"), names)
        os.chdir(before)
    return names


def guide() -> None:
    """Each name of the module is said; `chapters.py` runs the snippets."""
    text = (ROOT / "docs/python.md").read_text()
    said = set(re.findall(r"`(\w+)`", text))
    missing = {name for name in pl.__all__ if name not in said and f"pl.{name}" not in text}
    assert missing <= {"Diagnostic", "Error", "Finding", "Fit", "Fits", "Linearization", "Result", "Run", "Study", "System", "Table", "version"}, missing


def readme() -> None:
    """The block of README that imports the module, with the flights as its files."""
    text = (ROOT / "README.md").read_text()
    (block,) = re.findall(r"^((?:    .*\n)*    import pilotage as pl\n(?:    .*\n)+)", text, re.M)
    names = within_a_folder(["files = sorted(__import__('glob').glob('flights/*.csv'))", dedent(block)], "README.md")
    assert names["fit"].converged


def notebook(path: Path) -> None:
    cells = json.loads(path.read_text())["cells"]
    snippets = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    lines = [line for snippet in snippets for line in snippet.splitlines() if line.strip()]
    assert len(lines) < 40, f"{path.name} has {len(lines)} lines of code"
    assert all(not cell.get("outputs") for cell in cells), "outputs are not kept in the repository"
    FOUND[path.stem](within_a_folder(snippets, path.name))


def a_pilot(names: dict[str, object]) -> None:
    assert names["fit"].converged
    overshoot = names["overshoot"]
    assert len(overshoot) == len(names["gains"])
    assert overshoot[-1] > overshoot[0]


def a_study(names: dict[str, object]) -> None:
    """The loop is stable, and its settling depends on the gain."""
    overshoot = names["study"].measures["overshoot"]
    assert len(overshoot) == 200 and overshoot.min() < overshoot.max()
    assert names["closed"].stability == "stable", names["closed"].stability


# What a notebook finds.
FOUND = {"from_flights_to_fmu": a_pilot, "fmus_of_anybody": a_study}


if __name__ == "__main__":
    guide()
    readme()
    found = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))
    assert found
    for path in found:
        notebook(path)
