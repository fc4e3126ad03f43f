"""Closes the loop of pilot and quadcopter by fmuloader: loader.py PILOT QUADCOPTER TARGET STOP STEP

Prints the quadcopter's outputs at the end, with all digits.
"""

import sys

from fmpy import read_model_description
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

target, stop, step = map(float, sys.argv[3:])


class Fmu:
    def __init__(self, path, name):
        description = read_model_description(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.component = Fmi2Slave(path, model_identifier=description.coSimulation.modelIdentifier)
        self.component.instantiate(name, Fmi2Type.CO_SIMULATION, guid=description.guid)
        self.component.setup_experiment(start_time=0.0)
        self.component.enter_initialization_mode()

    def get(self, *names):
        return self.component.get_real([self.references[name] for name in names])

    def set(self, name, value):
        self.component.set_real([self.references[name]], [value])


pilot, quadcopter = Fmu(sys.argv[1], "pilot"), Fmu(sys.argv[2], "quadcopter")
pilot.set("target", target)
for fmu in (pilot, quadcopter):
    fmu.component.exit_initialization_mode()
for k in range(round(stop / step)):
    (stick,), (z,) = pilot.get("stick"), quadcopter.get("z")
    quadcopter.set("stick", stick)
    pilot.set("position", z)
    for fmu in (pilot, quadcopter):
        fmu.component.do_step(k * step, step)
print("outputs", *(repr(v) for v in quadcopter.get("z", "phi", "v", "q", "omega_f", "omega_b")))
