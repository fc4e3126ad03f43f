"""Simulates an FMU alone in libcosim: container_in_libcosim.py FMU STOP STEP

Prints its real outputs at the end, with all digits, in the order of the description.
"""

import sys

from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

NANOSECONDS = 1_000_000_000

path = sys.argv[1]
stop, step = map(float, sys.argv[2:])
execution = CosimExecution.from_step_size(step_size=round(step * NANOSECONDS))
slave = execution.add_local_slave(CosimLocalSlave(fmu_path=path, instance_name="one"))
outputs = [own for own in read_model_description(path).modelVariables if own.causality == "output" and own.type == "Real"]
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.simulate_until(round(stop * NANOSECONDS))
print(*(repr(float(value)) for value in observer.last_real_values(slave, [own.valueReference for own in outputs])))
