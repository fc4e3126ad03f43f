"""Simulates an FMU with fmpy, which validates it first: container_in_fmpy.py FMU STOP STEP [NAME=VALUE ...]

Prints the outputs' names, then a row for each communication point: time and outputs. Where the FMU keeps states, the run is
repeated from its middle: with a state, and with that of bytes; the ends must be the same numbers.
"""

import shutil
import sys

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

path, stop, step = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
values = dict(own.split("=") for own in sys.argv[4:])
description = read_model_description(path, validate=True)
outputs = [own for own in description.modelVariables if own.causality == "output" and own.type in ("Real", "Float64")]
names = [own.name for own in outputs]
result = simulate_fmu(
    path, stop_time=stop, step_size=step, output_interval=step, output=names, start_values=values, fmi_type="CoSimulation"
)
print(",".join(["time", *names]))
for row in result:
    print(",".join(repr(float(value)) for value in row))

folder = extract(path)
kinds = {"2": FMU2Slave, "3": FMU3Slave}
is_fmi3 = description.fmiVersion.startswith("3")
references = [own.valueReference for own in outputs]


def instance(name):
    own = kinds[description.fmiVersion[0]](
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=name,
    )
    own.instantiate()
    if is_fmi3:
        own.enterInitializationMode(startTime=0.0)
    else:
        own.setupExperiment(startTime=0.0)
        own.enterInitializationMode()
    own.exitInitializationMode()
    return own


def steps(own, first, count):
    for k in range(first, first + count):
        own.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
    return own.getFloat64(references) if is_fmi3 else own.getReal(references)


# Two instances in one process share nothing.
one, other = instance("one"), instance("other")
steps(one, 0, 5)
state = one.getFMUState()
ahead = steps(one, 5, 5)
steps(other, 0, 3)
one.setFMUState(state)
assert steps(one, 5, 5) == ahead
if description.coSimulation.canSerializeFMUstate:
    other.setFMUState(other.deserializeFMUState(one.serializeFMUState(state)))
    assert steps(other, 5, 5) == ahead
one.reset()
if is_fmi3:
    one.enterInitializationMode(startTime=0.0)
else:
    one.setupExperiment(startTime=0.0)
    one.enterInitializationMode()
one.exitInitializationMode()
assert steps(one, 0, 10) == ahead
for own in (one, other):
    own.terminate()
    own.freeInstance()
shutil.rmtree(folder)
