"""The virtual environment with CasADi and IPOPT, in the ignored folder .venv/casadi."""

import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def enter():
    """Continues the running script inside the environment; makes it where it is missing."""
    home = ROOT / ".venv" / "casadi"
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if Path(sys.prefix).resolve() == home.resolve():
        return
    if not python.exists():
        venv.create(home, with_pip=True)
        requirements = HERE / "requirements.txt"
        subprocess.run([python, "-m", "pip", "install", "-q", "-r", requirements], check=True)
    sys.exit(subprocess.run([python, *sys.argv]).returncode)
