"""Closes the loop of pilot and quadcopter in ecos: ecos.py PILOT QUADCOPTER TARGET STOP STEP

Prints the quadcopter's outputs at the end, with all digits.
"""

import ctypes
import sys
from pathlib import Path

# ecos needs it and does not bring it; where pip puts it no loader looks.
ctypes.CDLL(Path(sys.prefix) / "lib" / "libtbb.so.12", ctypes.RTLD_GLOBAL)

from ecospy import EcosSimulation, EcosSimulationStructure

target, stop, step = map(float, sys.argv[3:])
names = ["z", "phi", "v", "q", "omega_f", "omega_b"]
with EcosSimulationStructure() as structure:
    structure.add_model("pilot", sys.argv[1])
    structure.add_model("quadcopter", sys.argv[2])
    structure.make_real_connection("pilot::stick", "quadcopter::stick")
    structure.make_real_connection("quadcopter::z", "pilot::position")
    structure.add_parameter_set("flight", {"pilot::target": target})
    with EcosSimulation(structure=structure, step_size=step) as simulation:
        simulation.init(parameter_set="flight")
        simulation.step(round(stop / step))
        print("outputs", *(repr(simulation.get_real(f"quadcopter::{name}")) for name in names))
