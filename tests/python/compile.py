"""fmpy compiles the sources of each FMU, and finds nothing wrong with it: `compile.py FMU ...`."""

import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from fmpy import extract, platform, platform_tuple
from fmpy.build import build_platform_binary
from fmpy.validation import validate_fmu

for path in sys.argv[1:]:
    findings = validate_fmu(path)
    if findings:
        sys.exit("\n".join([path, *findings]))
    with TemporaryDirectory() as folder:
        extract(path, unzipdir=folder)
        build_platform_binary(folder, configuration="Release", all_warnings=True)
        made = [file for name in (platform, platform_tuple) for file in Path(folder, "binaries", name).glob("*.so")]
        if not made:
            sys.exit(f"{path}: fmpy made no binary")
        with zipfile.ZipFile(path, "a") as archive:
            archive.write(made[0], made[0].relative_to(folder))
    print(f"compiled {path}")
