"""Counts the FMUs that fmpy finds wrong: count.py FOLDER...

Prints for each folder: its name, how many FMUs there are, and how many fmpy finds something wrong with;
then the names of those that it finds nothing wrong with.
"""

import sys
from pathlib import Path

from fmpy.validation import validate_fmu

for folder in map(Path, sys.argv[1:]):
    found = {path.stem: bool(validate_fmu(str(path))) for path in sorted(folder.glob("*.fmu"))}
    clean = [name for name, is_found in found.items() if not is_found]
    print(folder.name, len(found), len(found) - len(clean), *clean)
