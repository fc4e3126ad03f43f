"""Virtual environments for scripts, in the ignored folder .venv."""

import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def enter(name="casadi", install=("-r", HERE / "requirements.txt")):
    """Continues the running script inside an environment; makes it where it is missing: CasADi with IPOPT."""
    home = ROOT / ".venv" / name
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if Path(sys.prefix).resolve() == home.resolve():
        return
    if not python.exists():
        venv.create(home, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *install], check=True)
    sys.exit(subprocess.run([python, *sys.argv]).returncode)
