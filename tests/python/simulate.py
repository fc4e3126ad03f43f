"""Simulates an FMU: simulate.py FMU STOP STEP [NAME=VALUE ...]

Prints a line for each communication point, time and outputs, with all digits.
"""

import sys

from fmpy import simulate_fmu

path, stop, step, *assignments = sys.argv[1:]
start_values = dict(a.split("=") for a in assignments)
result = simulate_fmu(
    path,
    validate=True,
    stop_time=float(stop),
    step_size=float(step),
    output_interval=float(step),
    start_values=start_values,
    fmi_type="CoSimulation",
    debug_logging=True,
    set_stop_time=True,
)
for row in result:
    print(*(repr(float(value)) for value in row))
