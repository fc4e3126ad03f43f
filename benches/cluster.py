"""Throughput of studies on a Dask cluster of this machine, over 1, 2 and 4 workers of one thread, beside that of this process.

    python benches/cluster.py [SAMPLES]

Run it by a Python into which `pip install '.[dask]'` has put pilotage. A sample is a co-simulation of pilot and quadcopter (15 s
in steps of 0.05 s). All studies must have the same bytes. Times are those of the wall, with the study's first sample and its
summary, without the start of the cluster; more workers than cores cannot be faster than cores.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster

import pilotage as pl


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        pilot = [Path(sys.executable).parent / "pilotage", "export", "pilot", "--preset", "paper", "-o", "pilot.fmu"]
        subprocess.run(pilot, check=True, stdout=subprocess.DEVNULL)
        pl.export("quadcopter", "quadcopter.fmu")
        system = pl.System().add("pilot", "pilot.fmu").add("vehicle", "quadcopter.fmu")
        system.connect("pilot.stick", "vehicle.stick").connect("vehicle.z", "pilot.position")
        vary = {"vehicle.mass": "normal(1.2, 0.05)", "pilot.target": "uniform(5, 15)"}
        found: set[bytes] = set()

        def study(name: str, client: Client | None) -> float:
            begun = time.perf_counter()
            pl.sweep(system, vary, samples=count, stop_time=15, step=0.05, isolate=False, output=name, client=client)
            seconds = time.perf_counter() - begun
            found.add(Path(name, "sweep.csv").read_bytes())
            print(f"{name:12} {seconds:8.2f} s {count / seconds:9.0f} samples/s", flush=True)
            return seconds

        print(f"{len(os.sched_getaffinity(0))} cores, {count} samples")
        study("process", None)
        for workers in (1, 2, 4):
            with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
                with Client(cluster) as client:
                    study(f"{workers} workers", client)
        assert len(found) == 1, "the studies differ"
        os.chdir("/")


if __name__ == "__main__":
    main()
