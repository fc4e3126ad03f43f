"""Puts pilot and quadcopter into one FMU with fmpy: container.py PILOT QUADCOPTER TARGET STEP CONTAINER

It has the outputs of the quadcopter, by their names, and takes communication steps of STEP [s] within.
"""

import sys
import tempfile
from pathlib import Path

from fmpy import read_model_description
from fmpy.container_fmu.cli import create_container_fmu
from fmpy.container_fmu.config import Component, Configuration, Connection
from fmpy.model_description import (
    CoSimulation,
    DefaultExperiment,
    ModelDescription,
    ModelVariable,
    Unknown,
)

files = [Path(name) for name in sys.argv[1:3]]
target, step = map(float, sys.argv[3:5])
components = [Component(file.stem, file, read_model_description(file)) for file in files]
pilot, quadcopter = components


def variable(component, name):
    return next(v for v in component.modelDescription.modelVariables if v.name == name)


mappings = {}
names = ["z", "phi", "v", "q", "omega_f", "omega_b"]
for name in names:
    outer = ModelVariable(name=name, valueReference=0, type="Real", causality="output", initial="calculated")
    mappings[outer] = [(quadcopter, variable(quadcopter, name))]
outer = ModelVariable(
    name="target", valueReference=0, type="Real", causality="parameter", variability="fixed", start=repr(target)
)
mappings[outer] = [(pilot, variable(pilot, "target"))]
time = ModelVariable(
    name="time", valueReference=0, type="Real", causality="independent", variability="continuous"
)


def connection(start, output, end, into):
    ends = [variable(start, output)], [variable(end, into)]
    ends[0][0].type = "Float64"
    return Connection(start, ends[0], end, ends[1])


description = ModelDescription(
    fmiVersion="2.0",
    modelName="closed_loop",
    instantiationToken="closed_loop",
    coSimulation=CoSimulation(modelIdentifier="container_fmu", fixedInternalStepSize=step),
    defaultExperiment=DefaultExperiment(startTime="0.0", stopTime="15.0", stepSize=repr(step)),
    # fmpy's container has the time under the first reference.
    modelVariables=[time, *mappings],
)
description.outputs = [Unknown(variable=v) for v in list(mappings)[: len(names)]]
configuration = Configuration(
    parallelDoStep=False,
    modelDescription=description,
    components=components,
    connections=[
        connection(pilot, "stick", quadcopter, "stick"),
        connection(quadcopter, "z", pilot, "position"),
    ],
    variableMappings=mappings,
)
with tempfile.TemporaryDirectory() as folder:
    unzipped = Path(folder) / "unzipped"
    unzipped.mkdir()
    create_container_fmu(configuration, unzipped, Path(sys.argv[5]))
