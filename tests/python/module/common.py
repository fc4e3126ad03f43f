"""What the tests of the Python module share."""

import json
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FLIGHTS = sorted((ROOT / "examples/trials").glob("*.csv"))
# The command that the wheel has brought.
COMMAND = Path(sys.executable).parent / "pilotage"


def command(*words: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Runs the command of the wheel."""
    given = [str(COMMAND), *map(str, words)]
    return subprocess.run(given, cwd=cwd, capture_output=True, text=True, check=False)


def printed(*words: object, cwd: Path | None = None) -> dict:
    """The object that the command prints."""
    ended = command(*words, "--json", cwd=cwd)
    assert ended.stdout, ended.stderr
    return json.loads(ended.stdout)


class Folder(unittest.TestCase):
    """Tests in a folder with the FMUs of pilot and quadcopter."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        for words in (["pilot", "--preset", "paper"], ["quadcopter"]):
            ended = command("export", *words, "-o", f"{words[0]}.fmu", cwd=cls.folder)
            assert ended.returncode == 0, ended.stderr
        cls.pilot, cls.quadcopter = cls.folder / "pilot.fmu", cls.folder / "quadcopter.fmu"
