"""Studies on a Dask cluster of three processes: the bytes of one machine, though a worker is killed."""

import os
import signal
import sys
import threading
import time
import unittest
from pathlib import Path

import numpy as np
from common import FLIGHTS, ROOT, Folder
from distributed import Client, LocalCluster

import pilotage as pl


def kept(dask_worker) -> dict[str, int]:
    """The files that a worker keeps, and when it got them."""
    folder = Path(dask_worker.local_directory) / "pilotage"
    return {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}


class Clusters(Folder):
    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        cluster = LocalCluster(n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None)
        cls.client = Client(cluster)
        cls.addClassCleanup(cluster.close)
        cls.addClassCleanup(cls.client.close)

    def setUp(self) -> None:
        # One that was killed is started again.
        self.client.wait_for_workers(3)

    def system(self) -> pl.System:
        system = pl.System().add("pilot", self.pilot).add("vehicle", self.quadcopter)
        return system.connect("pilot.stick", "vehicle.stick").connect("vehicle.z", "pilot.position")

    def same(self, *studies: tuple[pl.Study, Path]) -> None:
        for name in ("sweep.csv", "sweep.json"):
            texts = [(folder / name).read_bytes() for _, folder in studies]
            self.assertEqual(*texts, name)

    def test_a_worker_is_killed(self) -> None:
        masses = np.linspace(0.8, 1.6, 120)
        masses[37] = -1.0
        words = {"table": {"vehicle.mass": masses}, "stop_time": 80, "step": 0.05, "isolate": False}
        folders = [self.folder / name for name in ("here", "there")]
        here = pl.sweep(self.system().set("pilot.target", 10), **words, output=folders[0])
        ids = self.client.run(os.getpid)
        seen: list[tuple[int, int]] = []
        killed: list[int] = []

        def kill() -> None:
            """Kills a worker that is in the midst of a part, after the one that tells how many there are to be."""
            while not killed:
                busy = {own: keys for own, keys in self.client.processing().items() if keys}
                if len(busy) == 3:
                    time.sleep(0.1)
                    killed.append(ids[next(iter(busy))])
                    os.kill(killed[0], signal.SIGKILL)

        thread = threading.Thread(target=kill, daemon=True)
        thread.start()
        there = pl.sweep(
            self.system().set("pilot.target", 10),
            **words,
            output=folders[1],
            client=self.client,
            progress=lambda done, total: seen.append((done, total)),
        )
        self.assertEqual(len(killed), 1)
        self.assertNotIn(killed[0], self.client.run(os.getpid).values())
        self.same((here, folders[0]), (there, folders[1]))
        self.assertEqual([k for k, reason in enumerate(there.reasons) if reason], [37])
        self.assertIn("mass", there.reasons[37] or "")
        self.assertEqual(seen, sorted(seen))
        self.assertEqual(seen[-1], (120, 120))

    def test_files_go_to_each_worker_once(self) -> None:
        # A system file names a model elsewhere and a table beside it.
        words = {"vary": {"vehicle.mass": [1.4, 1.5, 1.6]}, "stop_time": 5, "step": 0.05, "isolate": False}
        hover = ROOT / "examples/systems/hover.toml"
        before: dict[str, dict[str, int]] = {}
        for name in ("first", "second"):
            folders = [self.folder / f"{where}-{name}" for where in ("here", "there")]
            self.same(
                (pl.sweep(hover, **words, output=folders[0]), folders[0]),
                (pl.sweep(hover, **words, output=folders[1], client=self.client), folders[1]),
            )
            after = self.client.run(kept)
            self.assertTrue(all(len(own) >= 3 for own in after.values()), after)
            self.assertIn(before, ({}, after))
            before = after

    def test_a_study_that_was_stopped_goes_on(self) -> None:
        folders = [self.folder / name for name in ("whole", "stopped")]
        words = {"vary": {"vehicle.mass": "1:2:40"}, "stop_time": 5, "step": 0.05, "isolate": False}
        here = pl.sweep(self.system(), **words, output=folders[0])

        def stop(done: int, total: int) -> None:
            raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError):
            pl.sweep(self.system(), **words, output=folders[1], client=self.client, progress=stop)
        (part,) = (folders[1] / "parts").iterdir()
        other = {**words, "stop_time": 6}
        with self.assertRaisesRegex(pl.InputError, "another study"):
            pl.sweep(self.system(), **other, output=folders[1], client=self.client)
        seen: list[int] = []
        there = pl.sweep(
            self.system(),
            **words,
            output=folders[1],
            client=self.client,
            progress=lambda done, total: seen.append(done),
        )
        self.same((here, folders[0]), (there, folders[1]))
        self.assertEqual(len(seen), int(part.stem.rpartition("-")[2]) - 1)
        self.assertEqual({own.name for own in folders[1].iterdir()}, {"sweep.csv", "sweep.parquet", "sweep.json", "sweep.html"})
        with self.assertRaisesRegex(pl.InputError, "not empty"):
            pl.sweep(self.system(), **words, output=folders[1], client=self.client)

    def test_fits_and_bootstraps(self) -> None:
        drug = ROOT / "examples/problems/drug/problem.toml"
        problems = {"flights": FLIGHTS[:2], "file": drug, "none": self.folder / "none.csv", "array": pl.read_run(FLIGHTS[2])}
        seen: list[tuple[int, int]] = []
        words = {"progress": lambda done, total: seen.append((done, total))}
        here = pl.fit_many(problems)
        there = pl.fit_many(problems, client=self.client, **words)
        self.assertEqual(here.fits, there.fits)
        self.assertEqual([own and own.models for own in here.fits], [own and own.models for own in there.fits])
        self.assertEqual(here.reasons, there.reasons)
        self.assertEqual([own is not None for own in here.fits], [True, True, False, True])
        self.assertIn("none.csv", there.reasons[2] or "")
        self.assertEqual(seen, [(k, 4) for k in range(1, 5)])
        self.assertEqual(here["array"], pl.fit(problems["array"]))
        frame = there.to_frame()
        self.assertEqual(list(frame.index), list(problems))
        self.assertEqual(frame["converged"].tolist(), [True, True, False, True])
        fit = here["array"]
        assert fit is not None
        own, far = (fit.bootstrap(6, seed=2, client=client) for client in (None, self.client))
        self.assertTrue(own.equals(far))
        self.assertFalse(own.equals(fit.bootstrap(6, seed=3)))


if __name__ == "__main__":
    sys.exit(unittest.main())
