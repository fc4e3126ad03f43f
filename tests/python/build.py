"""Builds the FMUs of `components/`: build.py FOLDER

Prints the shared library of this Python, which these FMUs expect their host to have loaded.
"""

import os
import sys
import sysconfig
from pathlib import Path

from pythonfmu import FmuBuilder
from pythonfmu3 import FmuBuilder as FmuBuilder3

components = Path(__file__).parent / "components"
FmuBuilder.build_FMU(script_file=components / "lag.py", dest=sys.argv[1])
FmuBuilder3.build_FMU(script_file=components / "decay.py", dest=sys.argv[1])
name = sysconfig.get_config_var("INSTSONAME") or sysconfig.get_config_var("LDLIBRARY")
folders = [sysconfig.get_config_var(key) for key in ("LIBDIR", "LIBPL")]
candidates = [os.path.join(folder, name) for folder in folders if folder]
print(next((path for path in candidates if os.path.exists(path) and ".so" in path), ""))
