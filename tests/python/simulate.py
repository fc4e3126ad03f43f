"""Simulates an FMU: simulate.py FMU CoSimulation|ModelExchange STOP STEP [NAME=VALUE ...]

Prints a line for each communication point, time and outputs, with all digits; of model exchange also
one before and after each event.
"""

import sys

from fmpy import simulate_fmu

path, kind, stop, step, *assignments = sys.argv[1:]
start_values = dict(a.split("=") for a in assignments)
result = simulate_fmu(
    path,
    validate=True,
    stop_time=float(stop),
    step_size=float(step),
    output_interval=float(step),
    start_values=start_values,
    fmi_type=kind,
    # Of model exchange alone; co-simulation has the tolerance of its description.
    relative_tolerance=1e-10 if kind == "ModelExchange" else None,
    debug_logging=True,
    set_stop_time=True,
)
for row in result:
    print(*(repr(float(value)) for value in row))
