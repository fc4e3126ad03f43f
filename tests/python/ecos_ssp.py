"""Simulates an SSP of pilot and quadcopter in ecos, 15 s in steps of 0.05 s: ecos_ssp.py loop.ssp

Prints three of the quadcopter's outputs at the end, with all digits.
"""

import ctypes
import sys
from pathlib import Path

# ecos needs it and does not bring it; where pip puts it no loader looks.
ctypes.CDLL(Path(sys.prefix) / "lib" / "libtbb.so.12", ctypes.RTLD_GLOBAL)

from ecospy import EcosSimulation

with EcosSimulation(step_size=0.05, ssp_path=sys.argv[1]) as simulation:
    simulation.init(parameter_set="initialValues")
    simulation.step(300)
    print("outputs", *(repr(simulation.get_real(f"quadcopter::{name}")) for name in ["z", "phi", "v"]))
