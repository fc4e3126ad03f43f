"""The command in the wheel: as the one that is built by cargo."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from common import COMMAND, FLIGHTS, Folder, command

import pilotage as pl


class Commands(Folder):
    def test_it_is_the_command(self) -> None:
        own = command("--version")
        self.assertEqual(own.stdout.split(), ["pilotage", pl.version()])
        cargo = os.environ["PILOTAGE"]
        for words in (["--help"], ["fit"], ["fit", "--helq"], ["info", "nothing.fmu"], ["fit", "--help"]):
            ends = [subprocess.run([each, *words], capture_output=True, check=False) for each in (COMMAND, cargo)]
            self.assertEqual(*[(end.returncode, end.stdout, end.stderr) for end in ends])

    def test_it_starts_processes_of_its_own(self) -> None:
        # Whatever is in the working folder, and without anything in the environment.
        with tempfile.TemporaryDirectory() as folder:
            for name in ("pilotage", "numpy", "importlib"):
                Path(folder, name).mkdir()
                Path(folder, name, "__init__.py").write_text("raise SystemExit('the wrong one')")
            for start in ([COMMAND], [sys.executable, "-P", "-m", "pilotage"]):
                ended = subprocess.run(
                    [*start, "validate", self.pilot, self.quadcopter],
                    cwd=folder,
                    env={},
                    capture_output=True,
                    text=True,
                    check=False,
                )
                self.assertEqual((ended.returncode, ended.stderr), (0, ""), ended)
                words = ["cosim", self.quadcopter, "--isolate", "all", "--stop-time", "1", "--step", "0.1"]
                ended = subprocess.run([*start, *words], cwd=folder, env={}, capture_output=True, text=True, check=False)
                self.assertEqual(ended.returncode, 0, ended.stderr)

    def test_an_fmu_that_crashes_is_reported(self) -> None:
        ended = command("cosim", os.environ["CRASHING_FMU"], "--stop-time", 2, "--step", 0.1, cwd=self.folder)
        self.assertEqual(ended.returncode, 1)
        self.assertIn("ended the process", ended.stderr)

    def test_what_to_type_next_begins_with_its_name(self) -> None:
        path = f"{COMMAND.parent}{os.pathsep}{os.environ['PATH']}"
        ended = subprocess.run(
            [COMMAND, "export", "quadcopter", "-o", self.folder / "next.fmu"],
            env={**os.environ, "PATH": path},
            capture_output=True,
            text=True,
            check=True,
        )
        self.assertIn(f"next: pilotage validate {self.folder}/next.fmu", ended.stdout)

    def test_ctrl_c_ends_it_with_what_there_is(self) -> None:
        words = ["fit", *FLIGHTS, "--bootstrap", "1000", "--json", "-o", self.folder / "stopped.toml"]
        process = subprocess.Popen([COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            process.communicate(timeout=2)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate()
        self.assertEqual(process.returncode, 1, stderr)
        self.assertEqual(len(json.loads(stdout)["runs"]), len(FLIGHTS))


if __name__ == "__main__":
    sys.exit(unittest.main())
