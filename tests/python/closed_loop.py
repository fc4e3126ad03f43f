"""Closes the loop of pilot and quadcopter with fmpy alone, and compares with a result of `pilotage cosim`.

usage: closed_loop.py PILOT QUADCOPTER RESULT.csv jacobi|gauss-seidel TARGET STOP STEP
Prints the largest difference over all signals and times.
"""

import shutil
import sys

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.util import read_csv


class Component:
    """An FMU at its start time, with names instead of value references."""

    def __init__(self, name, path, stop):
        description = read_model_description(path)
        self.name = name
        self.folder = extract(path)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.outputs = [v.name for v in description.modelVariables if v.causality == "output"]
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        tolerance = description.defaultExperiment.tolerance
        self.fmu.setupExperiment(tolerance=float(tolerance), startTime=0.0, stopTime=stop)
        self.fmu.enterInitializationMode()

    def set(self, name, value):
        self.fmu.setReal([self.references[name]], [value])

    def get(self, name):
        return self.fmu.getReal([self.references[name]])[0]

    def row(self):
        """All outputs, by the names that the columns have."""
        values = self.fmu.getReal([self.references[name] for name in self.outputs])
        return {f"{self.name}.{name}": value for name, value in zip(self.outputs, values)}

    def step(self, t, h):
        self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


def closed_loop(pilot, quadcopter, algorithm, target, steps, h):
    """The rows of the closed loop, at the start and after each step."""
    pilot.set("target", target)
    # Neither stick nor z depends on an input at once: one exchange makes the values consistent.
    quadcopter.set("stick", pilot.get("stick"))
    pilot.set("position", quadcopter.get("z"))
    for component in (pilot, quadcopter):
        component.fmu.exitInitializationMode()
    rows = [pilot.row() | quadcopter.row()]
    for k in range(steps):
        t = k * h
        stick, position = rows[-1]["pilot.stick"], rows[-1]["quadcopter.z"]
        quadcopter.set("stick", stick)
        quadcopter.step(t, h)
        if algorithm == "gauss-seidel":
            # The vehicle first: the pilot's output `error` depends on the position at once.
            position = quadcopter.get("z")
        pilot.set("position", position)
        pilot.step(t, h)
        rows.append(pilot.row() | quadcopter.row())
    return rows


def main():
    pilot, quadcopter, result, algorithm = sys.argv[1:5]
    target, stop, h = map(float, sys.argv[5:])
    components = Component("pilot", pilot, stop), Component("quadcopter", quadcopter, stop)
    steps = round(stop / h)
    rows = closed_loop(*components, algorithm, target, steps, h)
    for component in components:
        component.close()
    table = read_csv(result)
    # To fmpy a column is named `instance.variable [unit]`.
    table.dtype.names = tuple(name.split(" [")[0] for name in table.dtype.names)
    assert list(table.dtype.names) == ["time", *rows[0]], table.dtype.names
    assert len(table) == steps + 1, len(table)
    assert all(table["time"][k] == k * h for k in range(steps + 1))
    moved = max(abs(row["quadcopter.z"]) for row in rows)
    assert moved > 1.0, f"the vehicle moved by {moved} m only"
    print(max(abs(row[name] - table[name][k]) for k, row in enumerate(rows) for name in row))


main()
