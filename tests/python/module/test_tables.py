"""Parquet files of the command, read by pandas and Arrow; quantiles of studies by NumPy."""

import json
import subprocess
import unittest

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from common import COMMAND, Folder, command

MODEL = """[model]
name = "plant"
[inputs]
level = { start = 2, unit = "m" }
[parameters]
lag = { start = 0.5, unit = "s", min = 0.01 }
[states]
y = { der = "(level - y) / lag", unit = "m" }
[outputs]
y = { unit = "m", description = "how high it is" }
rate = { value = "(level - y) / lag", unit = "m/s" }
"""
RUN = ("plant.toml", "--stop-time", 2, "--step", 0.05)


class Tables(Folder):
    def setUp(self) -> None:
        (self.folder / "plant.toml").write_text(MODEL)

    def run_command(self, *words: object) -> subprocess.CompletedProcess[str]:
        ended = command(*words, cwd=self.folder)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        return ended

    def test_pandas_reads_results_with_units(self) -> None:
        for file in ("r.csv", "r.parquet"):
            self.run_command("cosim", *RUN, "-o", file, "--force")
        csv, parquet = pd.read_csv(self.folder / "r.csv"), pd.read_parquet(self.folder / "r.parquet")
        self.assertEqual(list(parquet), ["time", "plant.y", "plant.rate"])
        self.assertTrue((parquet.dtypes == "float64").all())
        np.testing.assert_array_equal(csv.to_numpy(), parquet.to_numpy())
        self.assertEqual(parquet.attrs["units"], {"time": "s", "plant.y": "m", "plant.rate": "m/s"})
        self.assertEqual(parquet.attrs["descriptions"], {"plant.y": "how high it is"})

    def test_what_pandas_writes_is_read(self) -> None:
        time = np.linspace(0, 2, 9)
        frame = pd.DataFrame({"time [ms]": 1000 * time, "level [m]": np.sin(time), "word": "a", "n": np.arange(9, dtype="int32")})
        for compression in ("snappy", None):
            frame.to_parquet(self.folder / "in.parquet", compression=compression)
            self.run_command("cosim", *RUN, "--input", "table=in.parquet", "--connect", "table.level=plant.level", "-o", "fed.csv", "--force")
            fed = pd.read_csv(self.folder / "fed.csv")
            np.testing.assert_allclose(fed["plant.level [m]"], np.interp(fed["time"], time, np.sin(time)), atol=1e-12)
        frame.to_parquet(self.folder / "in.parquet", compression="zstd")
        ended = command("plot", "in.parquet", cwd=self.folder)
        self.assertEqual(ended.returncode, 2)
        self.assertIn("in.parquet", ended.stderr)
        self.assertNotIn("panicked", ended.stderr)

    def test_columns_of_times_are_seconds(self) -> None:
        seconds = np.array([0.0, 0.5, 2.0])
        start = pd.Timestamp("2026-01-01 10:00")
        times = {f"timedelta64[{unit}]": pd.to_timedelta(seconds, unit="s").astype(f"timedelta64[{unit}]") for unit in ("ms", "us", "ns")}
        times |= {f"datetime64[{unit}]": (start + pd.to_timedelta(seconds, unit="s")).astype(f"datetime64[{unit}]") for unit in ("ms", "us", "ns")}
        times["of day"] = (start + pd.to_timedelta(seconds, unit="s")).time
        for kind, time in times.items():
            with self.subTest(kind):
                pd.DataFrame({"time": time, "level [m]": [1.0, 2.0, 5.0]}).to_parquet(self.folder / "in.parquet")
                self.run_command("cosim", *RUN, "--input", "table=in.parquet", "--connect", "table.level=plant.level", "-o", "fed.csv", "--force")
                fed = pd.read_csv(self.folder / "fed.csv")
                np.testing.assert_allclose(fed["plant.level [m]"], np.interp(fed["time"], seconds, [1, 2, 5]), atol=1e-12)

    def test_studies_have_rows_and_trajectories(self) -> None:
        words = ("--vary", "plant.lag~uniform(0.2, 1)", "--vary", "plant.level~normal(2, 0.3)", "--samples", 60, "--trajectories")
        self.run_command("sweep", *RUN, *words, "--measure", "when(plant.y - 2)", "--measure", "last = final(plant.y)", "-o", "study")
        folder = self.folder / "study"
        csv, rows = pd.read_csv(folder / "sweep.csv"), pd.read_parquet(folder / "sweep.parquet")
        pd.testing.assert_frame_equal(csv, rows, check_dtype=False, check_exact=True)
        self.assertEqual(rows.attrs["units"], {"plant.lag": "s", "plant.level": "m"})
        self.assertEqual(pq.read_table(folder / "sweep.parquet").column("when(plant.y - 2)").null_count, csv.iloc[:, 3].isna().sum())
        traces = pd.read_parquet(folder / "trajectories.parquet")
        self.assertEqual(list(traces), ["sample", "time", "plant.y", "plant.rate"])
        traces = traces.merge(rows[["sample", "plant.lag", "plant.level"]], on="sample", suffixes=("", "_"))
        exact = traces["plant.level"] * (1 - np.exp(-traces["time"] / traces["plant.lag"]))
        np.testing.assert_allclose(traces["plant.y"], exact, atol=2e-5)
        # The fan on the page against NumPy's quantiles.
        self.run_command("plot", "study/sweep.html", "--figure", "fan", "-o", "fan.csv", "--force")
        fan = pd.read_csv(self.folder / "fan.csv")
        wide = traces.pivot(index="time", columns="sample", values="plant.y").to_numpy()
        median = fan[(fan["panel"] == fan["panel"].iloc[0]) & (fan["series"] == "50 %")]
        np.testing.assert_allclose(median["y"], np.quantile(wide, 0.5, axis=1), rtol=0, atol=1e-8)
        band = fan[(fan["panel"] == fan["panel"].iloc[0]) & (fan["series"] == "5 to 95 %")]["y"].to_numpy()
        n = len(wide)
        np.testing.assert_allclose(band[:n], np.quantile(wide, 0.05, axis=1), rtol=0, atol=1e-8)
        np.testing.assert_allclose(band[n:][::-1], np.quantile(wide, 0.95, axis=1), rtol=0, atol=1e-8)

    def test_csv_has_a_side_file(self) -> None:
        self.run_command("cosim", *RUN, "--metadata", "-o", "side.csv")
        columns = json.loads((self.folder / "side.csv-metadata.json").read_text())["tableSchema"]["columns"]
        self.assertEqual([own["titles"] for own in columns], list(pd.read_csv(self.folder / "side.csv")))
        self.assertEqual([own.get("schema:unitText") for own in columns], ["s", "m", "m/s"])


if __name__ == "__main__":
    assert COMMAND.is_file(), COMMAND
    unittest.main()
