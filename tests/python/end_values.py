"""What fmpy's simulations end with: end_values.py [FMU CoSimulation|ModelExchange STOP STEP]...

Prints a JSON object of the outputs for each. The FMUs need not be valid.
"""

import json
import sys

from fmpy import simulate_fmu

arguments = sys.argv[1:]
for path, kind, stop, step in zip(*(arguments[k::4] for k in range(4))):
    result = simulate_fmu(
        path,
        validate=False,
        fmi_type=kind,
        stop_time=float(stop),
        step_size=float(step),
        output_interval=float(step),
        relative_tolerance=1e-10 if kind == "ModelExchange" else None,
        set_stop_time=False,
    )
    scalars = [name for name in result.dtype.names if result[name].ndim == 1]
    print(json.dumps({name: float(result[name][-1]) for name in scalars if result[name].dtype.kind != "S"}))
