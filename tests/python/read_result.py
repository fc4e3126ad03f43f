"""Reads a result of `pilotage cosim` as fmpy does and prints names, number of rows and the last row.

usage: read_result.py RESULT.csv
"""

import json
import sys

from fmpy.util import read_csv

table = read_csv(sys.argv[1])
last = [float(value) for value in table[-1].tolist()]
print(json.dumps({"names": list(table.dtype.names), "rows": len(table), "last": last}))
