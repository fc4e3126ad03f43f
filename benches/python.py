"""Co-simulations of pilot and quadcopter (15 s in steps of 0.05 s) from Python, in Rust, and by a loop in FMPy with instances
that are reset; and how long Ctrl-C takes.

    python benches/python.py [COUNT]

Run it by a Python into which `pip install . fmpy` has put pilotage and FMPy. It builds the Rust program itself, with cargo, in
the profile of benches, or in that of the variable PROFILE. All FMUs run in the process of the caller; each way records every
output, begins anew for each target, and adds up the final heights, which must agree. Times are processor times, which a busy
machine disturbs less.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

import pilotage as pl

ROOT = Path(__file__).resolve().parents[1]
STOP, STEP = 15.0, 0.05


def targets(count: int) -> np.ndarray:
    return 5.0 + 10.0 * np.arange(count) / count


def from_python(pilot: str, quadcopter: str, count: int) -> tuple[float, float]:
    """With one opened system."""
    system = pl.System().add("pilot", pilot).add("quadcopter", quadcopter)
    system.connect("pilot.stick", "quadcopter.stick").connect("quadcopter.z", "pilot.position")
    words = {"stop_time": STOP, "step": STEP, "isolate": False}
    pl.simulate(system, **words)
    began, total = time.process_time(), 0.0
    for target in targets(count):
        result = pl.simulate(system, set={"pilot.target": target}, **words)
        total += result["quadcopter.z"][-1]
    return time.process_time() - began, total


def rust_program() -> str:
    """Builds the Rust program."""
    profile = ["--profile", os.environ["PROFILE"]] if "PROFILE" in os.environ else []
    command = ["cargo", "bench", "--quiet", *profile, "--bench", "repeated", "--no-run", "--message-format=json"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    built = [json.loads(line) for line in printed.splitlines()]
    return next(own["executable"] for own in built if own.get("target", {}).get("name") == "repeated")


def in_rust(pilot: str, quadcopter: str, count: int) -> tuple[float, float]:
    def used() -> float:
        own = resource.getrusage(resource.RUSAGE_CHILDREN)
        return own.ru_utime + own.ru_stime

    command, before = [PROGRAM, pilot, quadcopter, str(count)], used()
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return used() - before, float(printed.split()[-1])


class Slave:
    """An FMU that FMPy has loaded, with the references of its outputs."""

    def __init__(self, path: str) -> None:
        description = fmpy.read_model_description(path)
        self.references = {own.name: own.valueReference for own in description.modelVariables}
        self.outputs = [own.valueReference for own in description.modelVariables if own.causality == "output"]
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=Path(path).stem,
        )
        self.fmu.instantiate()

    def begin(self, values: dict[str, float]) -> None:
        self.fmu.reset()
        self.fmu.setupExperiment(startTime=0.0, stopTime=STOP)
        for name, value in values.items():
            self.fmu.setReal([self.references[name]], [value])
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()


def in_fmpy(pilot: str, quadcopter: str, count: int) -> tuple[float, float]:
    """The loop that one writes with FMPy: Jacobi's scheme, every output recorded."""
    human, vehicle = Slave(pilot), Slave(quadcopter)
    stick_out, position = human.references["stick"], human.references["position"]
    z, stick_in = vehicle.references["z"], vehicle.references["stick"]
    at_stick, at_z = human.outputs.index(stick_out), vehicle.outputs.index(z)
    began, total = time.process_time(), 0.0
    for target in targets(count):
        human.begin({"target": target})
        vehicle.begin({})
        rows = []
        for k in range(round(STOP / STEP) + 1):
            own, other = human.fmu.getReal(human.outputs), vehicle.fmu.getReal(vehicle.outputs)
            rows.append([k * STEP, *own, *other])
            if k * STEP >= STOP - STEP / 2:
                break
            human.fmu.setReal([position], [other[at_z]])
            vehicle.fmu.setReal([stick_in], [own[at_stick]])
            human.fmu.doStep(k * STEP, STEP)
            vehicle.fmu.doStep(k * STEP, STEP)
        total += np.array(rows)[-1, 1 + len(human.outputs) + at_z]
    return time.process_time() - began, total


def stopped() -> float:
    """Seconds from Ctrl-C to the exception, for fits: the longest of five."""
    flights = sorted((ROOT / "examples/trials").glob("*.csv"))
    longest, sent = 0.0, [0.0]

    def send() -> None:
        sent[0] = time.perf_counter()
        os.kill(os.getpid(), signal.SIGINT)

    for k in range(5):
        threading.Timer(0.3 + 0.2 * k, send).start()
        try:
            pl.fit(flights, bootstrap=1000)
        except pl.Interrupted:
            longest = max(longest, time.perf_counter() - sent[0])
    return longest


def main() -> None:
    global PROGRAM
    PROGRAM = rust_program()
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    with tempfile.TemporaryDirectory() as folder:
        fmus = [f"{folder}/pilot.fmu", f"{folder}/quadcopter.fmu"]
        pilot = ["pilotage", "export", "pilot", "--preset", "paper", "-o", fmus[0]]
        subprocess.run([Path(sys.executable).parent / pilot[0], *pilot[1:]], check=True, stdout=subprocess.DEVNULL)
        pl.export("quadcopter", fmus[1])
        few = max(count // 20, 20)
        ways = [("Rust", in_rust, count), ("Python", from_python, count), ("FMPy", in_fmpy, few)]
        each = {}
        for name, way, runs in ways:
            # The faster of two, in turn.
            seconds, total = min(way(*fmus, runs) for _ in range(2))
            each[name] = seconds / runs
            print(f"{name:12} {runs:6} co-simulations {1e6 * each[name]:9.1f} us each, sum of heights {total:.6f}")
        assert np.isclose(in_fmpy(*fmus, 20)[1], from_python(*fmus, 20)[1], rtol=1e-9)
    print(f"Python over Rust {each['Python'] / each['Rust']:.2f}, FMPy over Python {each['FMPy'] / each['Python']:.1f}")
    print(f"Ctrl-C to exception, the longest of five fits: {stopped():.3f} s")


if __name__ == "__main__":
    main()
