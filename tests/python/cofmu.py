"""Closes the loop of pilot and quadcopter in CoFmuPy: cofmu.py PILOT QUADCOPTER TARGET STOP STEP

Prints the quadcopter's outputs at the end, with all digits.
"""

import sys

from cofmupy import Coordinator, wrappers

target, stop, step = map(float, sys.argv[3:])

read = wrappers.read_model_description


def described(path):
    """CoFmuPy is made for fmpy 0.3.20, in which the default step is a number."""
    description = read(path)
    description.defaultExperiment.stepSize = float(description.defaultExperiment.stepSize)
    return description


wrappers.read_model_description = described


def wire(start, output, end, into):
    return {"source": {"id": start, "variable": output}, "target": [{"id": end, "variable": into}]}


coordinator = Coordinator()
coordinator.start(
    {
        "fmus": [
            {"id": "pilot", "path": sys.argv[1], "initialization": {"target": target}},
            {"id": "quadcopter", "path": sys.argv[2]},
        ],
        "connections": [
            wire("pilot", "stick", "quadcopter", "stick"),
            wire("quadcopter", "z", "pilot", "position"),
        ],
        "cosim_method": "jacobi",
        "iterative": False,
    }
)
for _ in range(round(stop / step)):
    coordinator.do_step(step)
names = ["z", "phi", "v", "q", "omega_f", "omega_b"]
values = [coordinator.get_variable(("quadcopter", name))[0] for name in names]
print("outputs", *(repr(float(value)) for value in values))
