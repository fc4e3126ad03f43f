"""Closes the loop of pilot and quadcopter in libcosim: libcosim.py PILOT QUADCOPTER TARGET STOP STEP

Prints the quadcopter's outputs at the end, with all digits. What libcosim and FMI Library say goes to
stderr, as they say it.
"""

import sys

from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

NANOSECONDS = 1_000_000_000

pilot, quadcopter = sys.argv[1:3]
target, stop, step = map(float, sys.argv[3:])
execution = CosimExecution.from_step_size(step_size=round(step * NANOSECONDS))


def add(path, name):
    """The slave's number, and its value references by name."""
    references = {v.name: v.valueReference for v in read_model_description(path).modelVariables}
    slave = CosimLocalSlave(fmu_path=path, instance_name=name)
    return execution.add_local_slave(slave), references


p, of_pilot = add(pilot, "pilot")
q, of_quadcopter = add(quadcopter, "quadcopter")
execution.real_initial_value(slave_index=p, variable_reference=of_pilot["target"], value=target)
execution.connect_real_variables(p, of_pilot["stick"], q, of_quadcopter["stick"])
execution.connect_real_variables(q, of_quadcopter["z"], p, of_pilot["position"])
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.simulate_until(round(stop * NANOSECONDS))
names = ["z", "phi", "v", "q", "omega_f", "omega_b"]
values = observer.last_real_values(q, [of_quadcopter[name] for name in names])
print("outputs", *(repr(value) for value in values))
