"""Fits from Python: those of the command, from files and from arrays; what is made of them."""

import os
import pickle
import shutil
import sys
import threading
import unittest

import control
import fmpy
import numpy as np
import pandas
from common import FLIGHTS, ROOT, Folder, command, printed

import pilotage as pl


def without_time(json: dict) -> dict:
    return {key: value for key, value in json.items() if key not in ("seconds", "notes")}


class Fits(Folder):
    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        cls.fit = pl.fit([pl.read_run(file) for file in FLIGHTS], initial_state="at-rest")

    def test_a_fit_is_that_of_the_command(self) -> None:
        words = ["fit", *FLIGHTS, "--initial-state", "at-rest", "-o", self.folder / "own.toml"]
        self.assertEqual(without_time(self.fit.json), without_time(printed(*words)))
        self.fit.save(self.folder / "saved.toml")
        own, saved = (self.folder / name for name in ("own.toml", "saved.toml"))
        # Comments say how and when it was made; runs of arrays have a name in place of a path.
        texts = [file.read_text().replace(f"{FLIGHTS[0].parent}/", "") for file in (own, saved)]
        lines = [[line for line in text.splitlines() if not line.startswith("#")] for text in texts]
        self.assertEqual(*[[line for line in each if not line.startswith("sha256")] for each in lines])

    def test_files_frames_and_arrays_are_the_same_flights(self) -> None:
        runs = [pl.read_run(file) for file in FLIGHTS[:2]]
        frames = [run.to_frame() for run in runs]
        named = [
            pandas.DataFrame({"time [s]": run.time, **{f"{name} [{run.units[name]}]": run[name] for name in run}})
            for run in runs
        ]
        dicts = [{"time": run.time, **{f"{name} [{run.units[name]}]": run[name] for name in run}} for run in runs]
        first, *others = [pl.fit(data) for data in (FLIGHTS[:2], runs, frames, named, dicts)]
        for other in others:
            values = [own.json["parameters"] for own in (first, other)]
            self.assertEqual(*values)
            self.assertEqual(list(first.runs.values()), list(other.runs.values()))

    def test_tables_are_what_the_numbers_say(self) -> None:
        fit = self.fit
        self.assertTrue(fit.converged)
        self.assertEqual(list(fit.params.columns), ["value", "sd", "low", "high", "class", "unit"])
        self.assertEqual(fit.params["value"].to_dict(), fit.values)
        sd = fit.params["sd"].to_numpy()
        np.testing.assert_allclose(np.sqrt(np.diag(fit.cov)), sd[: len(fit.cov)], rtol=0.2)
        self.assertIn("phase_margin", fit.derived.index)
        self.assertEqual([own.code for own in fit.diagnostics], [own["code"] for own in fit.json["doubts"]])
        # The objective is the sum of the squares of the residuals.
        squares = sum(np.nansum(own["position"] ** 2) for own in fit.residuals.values())
        self.assertAlmostEqual(squares, fit.json["chi2"], delta=1e-9 * squares)
        for name, run in fit.runs.items():
            residual = (run["recorded position"] - run["model position"]) / run["residual position"]
            np.testing.assert_allclose(residual, np.median(residual), rtol=1e-6, err_msg=name)
            np.testing.assert_allclose(fit.states[name]["vehicle.z"], run["model position"], atol=1e-9)

    def test_its_frequency_response_is_that_of_its_state_space(self) -> None:
        system = self.fit.to_control()
        paths = [own for name, own in self.fit.frequency_response().items() if "->" in name]
        omega, own = paths[0]
        stick, position = system.find_output("model_stick"), system.find_input("model_position")
        other = control.frequency_response(system[stick, position], omega).frdata[0, 0]
        np.testing.assert_allclose(own, -other, rtol=1e-5)
        loop = self.fit.frequency_response()["loop pilot.stick"]
        crossover = self.fit.derived["value"]["crossover_frequency"]
        gain = np.interp(np.log(crossover), np.log(loop[0]), np.log(np.abs(loop[1])))
        self.assertAlmostEqual(gain, 0.0, delta=1e-3)

    def test_it_pickles_prints_and_compares(self) -> None:
        again = pickle.loads(pickle.dumps(self.fit))
        self.assertEqual(again, self.fit)
        self.assertNotEqual(again, pl.fit(FLIGHTS[:2]))
        self.assertIn(self.fit.verdict, repr(again))
        html = again._repr_html_()
        self.assertIn("pilot.theta1", html)
        self.assertIn("data:image/png", html)

    def test_figures_have_what_was_recorded(self) -> None:
        figure = self.fit.plot()
        (axis,) = figure.axes
        self.assertEqual(len(axis.lines), 2 * len(FLIGHTS))
        np.testing.assert_array_equal(
            axis.lines[0].get_ydata(), next(iter(self.fit.runs.values()))["recorded position"]
        )
        self.assertEqual(len(self.fit.bode().axes), 2)

    def test_its_fmu_does_in_fmpy_what_it_does_here(self) -> None:
        path = self.folder / "fitted.fmu"
        self.fit.export(path, fmi=3, allow_unconverged=True)
        values = {"target": 1.0}
        own = pl.simulate_fmu(path, stop_time=5, output_interval=0.05, start_values=values, output=["stick"])
        other = fmpy.simulate_fmu(
            str(path), stop_time=5, output_interval=0.05, start_values=values, output=["stick"], fmi_type="CoSimulation"
        )
        np.testing.assert_allclose(own["time"], other["time"], atol=1e-9)
        np.testing.assert_allclose(own["stick"], other["stick"], atol=1e-9)

    def test_a_problem_file_is_fitted_and_profiled(self) -> None:
        problem = ROOT / "examples/problems/battery/problem.toml"
        fit = pl.fit(problem)
        words = ["fit", problem, "-o", self.folder / "cell.toml"]
        self.assertEqual(without_time(fit.json), without_time(printed(*words)))
        self.assertEqual(list(fit.models), ["cell-fitted"])
        name = "cell.r0"
        profile = pl.profile(fit, name)[name]
        best = np.argmin(np.abs(profile.time - fit.values[name]))
        self.assertEqual(best, np.argmin(profile["objective"]))
        self.assertLess(profile.interval["low"], fit.values[name])
        spread = pl.bootstrap(fit, 10, seed=3)
        again = printed(*words, "--bootstrap", 10, "--seed", 3, "--force")
        self.assertEqual(spread["sd"][name], again["parameters"][name]["bootstrap"]["sd"])

    def test_a_problem_is_written_for_runs(self) -> None:
        problem = pl.init(FLIGHTS[:2], self.folder / "problem.toml")
        own, other = pl.fit(problem), pl.fit(FLIGHTS[:2])
        self.assertEqual([round(value, 6) for value in own.values.values()], [round(value, 6) for value in other.values.values()])

    def test_two_threads_fit_at_once(self) -> None:
        found: list[pl.Fit] = []
        work = [threading.Thread(target=lambda: found.append(pl.fit(FLIGHTS[:2]))) for _ in range(2)]
        for thread in work:
            thread.start()
        for thread in work:
            thread.join()
        self.assertEqual(found[0], found[1])
        self.assertEqual(found[0], pl.fit(FLIGHTS[:2]))


    def test_a_forked_process_simulates_and_refuses_to_fit(self) -> None:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                result = pl.simulate(ROOT / "examples/systems/loop.toml", stop_time=1, step=0.1)
                try:
                    pl.fit(FLIGHTS[:1])
                except pl.InputError as error:
                    code = 0 if "forked" in str(error) and result.status == "completed" else 2
            finally:
                os._exit(code)
        self.assertEqual(os.waitpid(child, 0)[1], 0)

    def test_a_problem_with_an_fmu_is_fitted_in_a_process_of_its_own(self) -> None:
        examples = ROOT / "examples/problems/battery"
        for name in ("cell.toml", "drive.csv", "open_circuit.csv", "problem.toml"):
            shutil.copy(examples / name, self.folder)
        plain = pl.fit(self.folder / "problem.toml")
        pl.export(self.folder / "cell.toml", self.folder / "cell.fmu")
        text = (self.folder / "problem.toml").read_text().replace('"cell.toml"', '"cell.fmu"')
        (self.folder / "problem.toml").write_text(text)
        fit = pl.fit(self.folder / "problem.toml")
        for name, value in plain.values.items():
            self.assertAlmostEqual(fit.values[name], value, delta=1e-4 * abs(value))
        self.assertEqual(list(fit.runs), list(plain.runs))
        (run,), (other,) = fit.runs.values(), plain.runs.values()
        np.testing.assert_allclose(run["model voltage"], other["model voltage"], rtol=1e-4)
        self.assertIn(fit.verdict, fit.summary)


class Refusals(unittest.TestCase):
    def test_errors_have_the_commands_words(self) -> None:
        for words, call in [
            (["fit", "nothing.csv"], lambda: pl.fit("nothing.csv")),
            (["fit", FLIGHTS[0], "--order", "9"], lambda: pl.fit(FLIGHTS[0], order=9)),
            (["fit", FLIGHTS[0], "--vehicle", "no.toml"], lambda: pl.fit(FLIGHTS[0], vehicle="no.toml")),
            (["model", "check", "cossover"], lambda: pl.Model("cossover")),
        ]:
            ended = command(*words)
            self.assertEqual(ended.returncode, 2)
            with self.assertRaises(pl.InputError) as raised:
                call()
            said = "\n".join(line for line in ended.stderr.splitlines() if not line.startswith("note: "))
            self.assertEqual(f"error: {raised.exception}".split(), said.split())
            self.assertIsInstance(raised.exception, ValueError)
            self.assertEqual(str(pickle.loads(pickle.dumps(raised.exception))), str(raised.exception))

    def test_arrays_that_are_no_runs_are_refused(self) -> None:
        time = np.arange(5.0)
        for data, words in [
            ({"position [m]": time}, "no column `time`"),
            ({"time": time, "position [m]": time[:3]}, "`position` has 3 values, and there are 5 times"),
            ({"time [ms]": time}, "the time is in ms"),
            ({"time": time, "position": ["a"] * 5}, "is not all numbers"),
            (7, "is int"),
        ]:
            with self.assertRaisesRegex(pl.InputError, words):
                pl.fit([data])

    def test_text_of_a_model_is_checked_with_its_line(self) -> None:
        with self.assertRaises(pl.InputError) as raised:
            pl.Model('[model]\nname = "x"\n[states]\nx = { der = "y" }\n')
        self.assertTrue(str(raised.exception).startswith("model.toml:4:"), raised.exception)


if __name__ == "__main__":
    sys.exit(unittest.main())
