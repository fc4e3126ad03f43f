"""Validates FMUs: prints the number of variables of each; fails with the findings."""

import sys

from fmpy import dump, read_model_description
from fmpy.validation import validate_fmu

for path in sys.argv[1:]:
    findings = validate_fmu(path)
    if findings:
        sys.exit("\n".join([path, *findings]))
    dump(path)
    print(len(read_model_description(path, validate=True).modelVariables))
