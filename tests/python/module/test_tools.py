"""The other commands from Python: what they print, and what they write."""

import sys
import unittest

import numpy as np
from common import FLIGHTS, ROOT, Folder, command, printed

import pilotage as pl


class Tools(Folder):
    def test_flags_of_an_exported_pilot_are_its_own(self) -> None:
        file = self.folder / "paper.fmu"
        pl.export("pilot", file, preset="paper", fmi=3)
        self.assertEqual(pl.info(file)["fmiVersion"], "3.0")

    def test_flights_are_made_and_looked_at(self) -> None:
        runs = pl.synth(self.folder / "made", targets="5", runs=2, duration=8, seed=7)
        self.assertEqual([run.units["position"] for run in runs], ["m", "m"])
        own = pl.excitation(runs)
        files = sorted((self.folder / "made").glob("*.csv"))
        json = printed("trials", "check", *files)
        self.assertEqual(own["excitation"], json["excitation"])
        again = command("trials", "synth", "--targets=5", "--runs=2", "--duration=8", "--seed=7", "-o", self.folder / "again")
        self.assertEqual(again.returncode, 0, again.stderr)
        for run, file in zip(runs, files, strict=True):
            self.assertEqual(run, pl.read_run(self.folder / "again" / file.name))

    def test_problems_are_compared(self) -> None:
        files = [self.folder / f"{pilot}.toml" for pilot in ("crossover", "linear")]
        for file in files:
            pl.init(FLIGHTS[:3], file, pilot=file.stem)
        own = pl.compare(*files)
        json = printed("compare", *files)
        self.assertEqual(own, json)

    def test_the_best_controls_are_those_of_the_literature(self) -> None:
        verdict, course = pl.optimise(ROOT / "examples/optimal_control/brachistochrone.toml")
        self.assertEqual(verdict["status"], "optimal")
        self.assertAlmostEqual(verdict["objective"], 0.8243386, delta=1e-5)
        self.assertAlmostEqual(course.time[-1], verdict["objective"], delta=1e-6)

    def test_a_map_is_drawn(self) -> None:
        words = {"speeds": "0:10:10", "heights": "5:100:3"}
        json = pl.hv(self.folder / "map", intervals=20, **words)
        self.assertTrue((self.folder / "map/hv.html").is_file())
        flags = [f"--{name}={value}" for name, value in words.items()]
        other = printed("hv", *flags, "--intervals=20", "-o", self.folder / "other")
        self.assertEqual(json["columns"] if "columns" in json else json.keys(), other["columns"] if "columns" in other else other.keys())

    def test_studies_are_those_of_the_command(self) -> None:
        system = pl.System().add("pilot", self.pilot).add("vehicle", self.quadcopter)
        system.connect("pilot.stick", "vehicle.stick").connect("vehicle.z", "pilot.position").set("pilot.target", 10)
        words = {"vary": {"vehicle.mass": [1.0, 1.4], "pilot.target": "5:10:2"}, "measure": {"last": "final(vehicle.z)"}}
        study = pl.sweep(system, **words, stop_time=2, step=0.05, isolate=False)
        self.assertEqual(len(study), 4)
        for k in range(4):
            values = {name: own[k] for name, own in study.values.items()}
            run = pl.simulate(system, stop_time=2, step=0.05, set=values, isolate=False)
            self.assertEqual(run["vehicle.z"][-1], study.measures["last"][k])
        self.assertEqual(study.to_frame().shape, (4, 4))
        parts = [self.folder / f"part{k}" for k in (1, 2)]
        for k, part in enumerate(parts, 1):
            pl.sweep(system, **words, stop_time=2, step=0.05, isolate=False, shard=f"{k}/2", output=part)
        joined = pl.merge(parts, self.folder / "joined")
        np.testing.assert_array_equal(joined.measures["last"], study.measures["last"])
        # A sample that fails is a row with its reason.
        table = {"vehicle.mass": np.array([1.2, -1.0])}
        failed = pl.sweep(system, table=table, stop_time=2, step=0.05, isolate=False)
        self.assertIsNone(failed.reasons[0])
        self.assertIn("mass", failed.reasons[1] or "")
        self.assertTrue(np.isnan(failed.measures["final(vehicle.z)"][1]))

    def test_fmus_are_checked(self) -> None:
        broken = self.folder / "broken.fmu"
        broken.write_bytes(self.pilot.read_bytes()[:-40])
        found = pl.validate(self.pilot, broken)
        self.assertEqual({own.fmu for own in found}, {str(broken)})
        self.assertIn("error", {own.severity for own in found})
        self.assertEqual(pl.info(self.pilot), printed("info", self.pilot))

    def test_tables_are_frames_and_rows(self) -> None:
        run = pl.read_run(FLIGHTS[0])
        frame = run.to_frame()
        self.assertEqual(frame.attrs["units"], run.units)
        np.testing.assert_array_equal(run.to_numpy()["position"], frame["position"])
        self.assertEqual(run.plot("position").lines[0].get_label(), "position [m]")
        self.assertIn("<table", run._repr_html_())
        run.write(self.folder / "again.csv")
        self.assertEqual(pl.read_run(self.folder / "again.csv"), run)


if __name__ == "__main__":
    sys.exit(unittest.main())
