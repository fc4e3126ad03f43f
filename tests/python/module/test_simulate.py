"""Simulations from Python: those of the command; FMUs that crash; threads; Ctrl-C."""

import os
import pickle
import signal
import sys
import threading
import unittest

import fmpy
import numpy as np
import pandas
from common import ROOT, Folder, command, printed

import pilotage as pl

LOOP = ROOT / "examples/systems/loop.toml"


class Simulations(Folder):
    def system(self) -> pl.System:
        system = pl.System().add("pilot", self.pilot).add("quadcopter", self.quadcopter)
        system.connect("pilot.stick", "quadcopter.stick").connect("quadcopter.z", "pilot.position")
        return system.set("pilot.target", 10)

    def test_a_result_is_that_of_the_command(self) -> None:
        wires = ["--connect", "pilot.stick=quadcopter.stick", "--connect", "quadcopter.z=pilot.position"]
        for algorithm in ("jacobi", "gauss-seidel", "strong"):
            rest = ["--stop-time", "15", "--step", "0.05", "--algorithm", algorithm, "--force"]
            ended = command(
                "cosim", self.pilot, self.quadcopter, *wires, "--set", "pilot.target=10", *rest, cwd=self.folder
            )
            self.assertEqual(ended.returncode, 0, ended.stderr)
            own = pl.read_run(self.folder / "result.csv")
            for isolate in (True, False, ["pilot"]):
                result = pl.simulate(
                    self.system(), stop_time=15, step=0.05, algorithm=algorithm, isolate=isolate
                )
                self.assertEqual(result, own, (algorithm, isolate))

    def test_an_opened_system_begins_anew_each_time(self) -> None:
        system = self.system()
        target = {"pilot.target": 20.0}
        for isolate in (False, True):
            first = pl.simulate(system, stop_time=5, step=0.05, isolate=isolate)
            other = pl.simulate(system, stop_time=5, step=0.05, isolate=isolate, set=target)
            self.assertEqual(pl.simulate(system, stop_time=5, step=0.05, isolate=isolate), first)
            self.assertNotEqual(other, first)
            fresh = self.system().set("pilot.target", 20)
            self.assertEqual(pl.simulate(fresh, stop_time=5, step=0.05, isolate=isolate), other)

    def test_a_system_file_has_its_exact_value(self) -> None:
        system = pl.System.read(LOOP)
        result = pl.simulate(system, stop_time=1, step=0.001, algorithm="strong")
        self.assertAlmostEqual(result["plant.y"][-1], 1 - np.exp(-2), delta=1e-6)
        again = pickle.loads(pickle.dumps(system))
        self.assertEqual(pl.simulate(again, stop_time=1, step=0.001, algorithm="strong"), result)

    def test_inputs_come_from_frames_and_arrays(self) -> None:
        time = np.linspace(0, 5, 51)
        stick = 0.1 * np.sin(time)
        frame = pandas.DataFrame({"stick": stick}, index=time)
        frame.attrs["units"] = {"stick": "1"}
        rows = np.array(list(zip(time, stick, strict=True)), dtype=[("time", "f8"), ("stick", "f8")])
        of = lambda data: pl.simulate(self.quadcopter, stop_time=5, step=0.05, algorithm="strong", input=data)
        first = of({"time": time, "stick": stick})
        self.assertEqual(of(frame), first)
        self.assertEqual(of(rows), first)
        model = pl.simulate(self.quadcopter, stop_time=5, step=0.05, algorithm="strong", input={"time": time, "stick": 0 * stick})
        self.assertNotEqual(model, first)

    def test_fmpys_words_give_what_fmpy_gives(self) -> None:
        words = {"stop_time": 5.0, "output_interval": 0.05, "start_values": {"stick": 0.1}, "output": ["z", "v"]}
        for kind in ("CoSimulation", "ModelExchange"):
            own = pl.simulate_fmu(self.quadcopter, fmi_type=kind, **words)
            other = fmpy.simulate_fmu(str(self.quadcopter), fmi_type=kind, **words)
            self.assertEqual(own.dtype.names, ("time", "z", "v"))
            np.testing.assert_allclose(own["time"], other["time"], atol=1e-9)
            for name in ("z", "v"):
                np.testing.assert_allclose(own[name], other[name], atol=1e-5, err_msg=kind)

    def test_a_linear_system_is_that_of_the_command(self) -> None:
        system = self.system()
        own = pl.linearize(system, loop=("pilot.stick", "quadcopter.stick"))
        words = ["--connect", "pilot.stick=quadcopter.stick", "--connect", "quadcopter.z=pilot.position"]
        json = printed(
            "linearize", self.pilot, self.quadcopter, *words, "--set", "pilot.target=10", "--loop", words[1]
        )
        self.assertEqual(own.json, json)
        poles = np.sort_complex(np.linalg.eigvals(own.A))
        np.testing.assert_allclose(np.sort_complex(own.poles), poles, rtol=1e-6, atol=1e-6)
        self.assertEqual(own.to_control().nstates, len(own.states))

    def test_models_step_and_simulate(self) -> None:
        text = '[model]\nname = "lag"\n[inputs]\nu = { unit = "1" }\n[states]\nx = { unit = "1", der = "(u - x) / 2" }\n'
        text = text.replace("/ 2", "/ tau") + '[parameters]\ntau = { start = 2, unit = "s" }\n[outputs]\ny = { unit = "1", value = "x" }\n'
        model = pl.Model(text)
        step = model.step(stop_time=10)
        (name,) = step
        np.testing.assert_allclose(step[name], 1 - np.exp(-step.time / 2), atol=1e-6)
        result = model.simulate(stop_time=4, step=0.5, set={"u": 1, "tau": 1})
        np.testing.assert_allclose(result["y"], 1 - np.exp(-result.time), atol=1e-6)
        self.assertEqual(result.units["tau"] if "tau" in result else "s", "s")
        pl.export(model, self.folder / "lag.fmu")
        rows = pl.simulate_fmu(self.folder / "lag.fmu", stop_time=4, output_interval=0.5, start_values={"u": 1, "tau": 1})
        np.testing.assert_allclose(rows["y"], result["y"], atol=1e-6)
        self.assertEqual(pl.validate(self.folder / "lag.fmu"), [])
        self.assertEqual(pl.info(self.folder / "lag.fmu")["modelName"], "lag")

    def test_two_threads_simulate_one_system(self) -> None:
        system = self.system()
        expected = {value: pl.simulate(system, stop_time=5, step=0.05, set={"pilot.target": value}) for value in (1, 2)}
        found: dict[int, list[pl.Result]] = {1: [], 2: []}

        def work(value: int) -> None:
            for _ in range(20):
                own = pl.simulate(system, stop_time=5, step=0.05, isolate=False, set={"pilot.target": value})
                found[value].append(own)

        threads = [threading.Thread(target=work, args=[value]) for value in found]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for value, own in found.items():
            self.assertEqual(len(own), 20)
            self.assertTrue(all(one == expected[value] for one in own))

    def test_an_fmu_that_crashes_takes_the_run_alone(self) -> None:
        crashing = os.environ["CRASHING_FMU"]
        with self.assertRaises(pl.FmuError) as raised:
            pl.simulate(crashing, stop_time=2, step=0.1)
        self.assertIn("ended its process", str(raised.exception))
        rows = raised.exception.result
        self.assertEqual(rows.status, "failed")
        self.assertGreater(len(rows.time), 0)
        self.assertLess(rows.time[-1], 2)
        # The next one is as if nothing had been.
        self.assertEqual(pl.simulate(LOOP, stop_time=1, step=0.1).status, "completed")

    def test_fmus_that_forget_to_reset_are_opened_anew(self) -> None:
        for name in ("FORGETTING_FMU", "REMEMBERING_FMU"):
            for isolate in (False, True):
                system = pl.System().add("fmu", os.environ[name])
                first, *others = [pl.simulate(system, stop_time=1, step=0.1, isolate=isolate) for _ in range(4)]
                self.assertAlmostEqual(first["fmu.y"][-1], np.exp(-1))
                self.assertEqual(others, [first] * 3)

    def test_studies_compare_and_print(self) -> None:
        vary = {"quadcopter.mass": "1:2:3"}
        measure = {"end": "final(quadcopter.z)", "never": "when(quadcopter.z - 1000)"}
        one, same = (pl.sweep(self.system(), vary, stop_time=1, measure=measure) for _ in range(2))
        self.assertEqual(one, same)
        self.assertNotEqual(one, pl.sweep(self.system(), vary, stop_time=1.5, measure=measure))
        self.assertRegex(repr(one), r"^Study of 3 samples, 0 failed.*\n  end: \S+, \S+, \S+\n  never: no values$")

    def test_progress_is_told(self) -> None:
        seen: list[tuple[int, int]] = []
        words = {"progress": lambda done, total: seen.append((done, total))}
        pl.simulate(LOOP, stop_time=1000, step=0.001, record_every=10.0, **words)
        self.assertEqual(seen, sorted(seen))
        self.assertEqual({total for _, total in seen}, {1_000_000})
        self.assertEqual(seen[-1], (1_000_000, 1_000_000))
        for isolate in (False, True):
            seen.clear()
            vary = {"quadcopter.mass": "1:2:40"}
            pl.sweep(self.system(), vary, stop_time=1, step=0.05, isolate=isolate, **words)
            self.assertEqual(seen, sorted(seen))
            self.assertEqual(seen[-1], (40, 40))

        def refuses(done: int, total: int) -> None:
            raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError):
            pl.simulate(LOOP, stop_time=1e7, step=0.001, record_every=1.0, progress=refuses)
        pl.sweep(LOOP, {"controller.gain": "0.5:1:3"}, stop_time=1, step=0.1, progress=True)

    def test_words_that_are_refused(self) -> None:
        for call, words in [
            (lambda: pl.simulate(self.system(), stop_time=1, step=0.1, algorithm="jakobi"), "jacobi"),
            (lambda: pl.simulate(self.system().set("pilot.tarqet", 1), stop_time=1, step=0.1), "pilot.target"),
            (lambda: pl.simulate(self.system(), stop_time=1, step=0.3), "step"),
            (lambda: pl.simulate(pl.System(), stop_time=1, step=0.1), "no models"),
            (lambda: pl.simulate_fmu(self.pilot, fmi_type="cs"), "CoSimulation"),
        ]:
            with self.assertRaisesRegex(pl.InputError, words):
                call()


class Interrupts(unittest.TestCase):
    def interrupted(self, call) -> object:
        """What a call has when Ctrl-C comes."""
        timer = threading.Timer(0.7, os.kill, [os.getpid(), signal.SIGINT])
        timer.start()
        try:
            with self.assertRaises(pl.Interrupted) as raised:
                call()
        finally:
            timer.cancel()
        return raised.exception.result

    def test_ctrl_c_gives_the_rows_so_far(self) -> None:
        rows = self.interrupted(lambda: pl.simulate(LOOP, stop_time=1e7, step=0.001, record_every=1.0))
        self.assertEqual(rows.status, "stopped")
        self.assertGreater(len(rows.time), 2)
        self.assertEqual(pl.simulate(LOOP, stop_time=1, step=0.1).status, "completed")

    def test_ctrl_c_stops_a_fit(self) -> None:
        flights = sorted((ROOT / "examples/trials").glob("*.csv"))
        fit = self.interrupted(lambda: pl.fit(flights, bootstrap=1000))
        # With what there was within 0.2 s, if anything.
        if fit is not None:
            self.assertEqual(len(fit.runs), len(flights))
        self.assertTrue(pl.fit(flights[:1]).json["iterations"])


if __name__ == "__main__":
    sys.exit(unittest.main())
