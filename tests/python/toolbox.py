"""Puts pilot and quadcopter into one FMU with the FMU manipulation toolbox:
toolbox.py PILOT QUADCOPTER TARGET STEP CONTAINER

It has the outputs of the quadcopter, by their names, and takes communication steps of STEP [s] within.
"""

import sys
from pathlib import Path

from fmu_manipulation_toolbox.assembly import Assembly, AssemblyNode

pilot, quadcopter, container = (Path(sys.argv[i]) for i in (1, 2, 5))
node = AssemblyNode(container.name, step_size=float(sys.argv[4]), auto_link=False, auto_input=False, auto_output=False)
for fmu in (pilot, quadcopter):
    node.add_fmu(fmu.name)
node.add_link(pilot.name, "stick", quadcopter.name, "stick")
node.add_link(quadcopter.name, "z", pilot.name, "position")
node.add_start_value(pilot.name, "target", sys.argv[3])
for name in ["z", "phi", "v", "q", "omega_f", "omega_b"]:
    node.add_output(quadcopter.name, name, name)
assembly = Assembly(fmu_directory=pilot.parent)
assembly.root = node
assembly.make_fmu()
