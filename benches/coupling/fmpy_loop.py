"""The same loop by hand in fmpy: prints microseconds per communication step, and y at the end."""

import sys
import time

import fmpy
from fmpy.fmi2 import FMU2Slave

STEPS, H = int(sys.argv[3]), float(sys.argv[4])


def instance(path):
    description = fmpy.read_model_description(path)
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="i",
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu


controller, integrator = instance(sys.argv[1]), instance(sys.argv[2])
u, y = controller.getReal([1])[0], integrator.getReal([1])[0]
best = float("inf")
started = time.perf_counter()
for k in range(STEPS):
    controller.setReal([0], [y])
    integrator.setReal([0], [u])
    controller.doStep(k * H, H)
    integrator.doStep(k * H, H)
    u, y = controller.getReal([1])[0], integrator.getReal([1])[0]
print((time.perf_counter() - started) * 1e6 / STEPS, y)
