"""Makes the synthetic data of examples/problems: the equations of problems_reference.py with known values, and normal
noise of fixed seeds. The data of hare_lynx are real and not made here.

    python3 tests/python/problems_data.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from problems_reference import FOLDER, PROBLEMS, UNITS, fixed  # noqa: E402

TRUTH = {
    "van_der_pol": [1.5, 0.5, 0.8],
    "fitzhugh_nagumo": [0.2, 0.2, 3.0, 0.2],
    "battery": [0.045, 0.022, 2400.0, 0.9],
    "dc_motor": [0.8, 1.5e-3, 0.06, 8e-5, 4e-5, 0.25],
    "reaction": [1.5e-3, 8e-4, 60e3, 85e3, 950.0, 1030.0],
    "drug": [1.4, 2.1, 3.4, 2.8, 0.52],
}


def levels(rng, count, shortest, longest, choices):
    """Values that hold for a random number of rows each."""
    held = (np.full(rng.integers(shortest, longest + 1), rng.choice(choices)) for _ in range(count))
    return np.concatenate(list(held))[:count]


def write(name, run, titles, given, rng, decimals, hidden=lambda column, k: False):
    """A file of time and inputs (given), in the units of the titles, and what a noisy sensor makes of them."""
    units = {title.split()[0]: (title.split() + ["[1]"])[1].strip("[]") for title in titles}
    si = {column: values * UNITS[units[column]] for column, values in given.items()}
    problem, truth = PROBLEMS[name], np.array(TRUTH[name])[:, None]
    p = dict(zip(problem.names(), truth))
    columns = given | {}
    if "sd" in units:
        h, _ = problem.simulate(p, run, si | {"sd": np.ones(len(si["time"]))}, fixed)["concentration"]
        columns["sd"] = si["sd"] = (0.15 + 0.05 * h[:, 0].real).round(2)
    for column, (h, sd) in problem.simulate(p, run, si, fixed).items():
        noisy = h[:, 0].real + np.ravel(sd).real * rng.standard_normal(len(h))
        columns[column] = noisy / UNITS[units[column]]

    def cell(column, k):
        empty = column not in given and hidden(column, k)
        return "" if empty else f"{round(columns[column][k], decimals[column]):.10g}"

    rows = (",".join(cell(column, k) for column in units) for k in range(len(given["time"])))
    (FOLDER / name / f"{run}.csv").write_text("\n".join([",".join(titles), *rows]) + "\n")


def main():
    write(
        "van_der_pol", "oscillation", ["time", "reading"],
        dict(time=0.2 * np.arange(101)), np.random.default_rng(11), dict(time=1, reading=3),
    )  # fmt: skip
    write(
        "fitzhugh_nagumo", "spikes", ["time", "voltage", "recovery"],
        dict(time=0.2 * np.arange(101)), np.random.default_rng(12), dict(time=1, voltage=3, recovery=3),
    )  # fmt: skip
    rng = np.random.default_rng(13)
    current = levels(rng, 121, 3, 9, [-2.0, 0.0, 1.0, 2.5, 5.0])
    current[:2] = 0.0
    write(
        "battery", "drive", ["time [s]", "current [A]", "voltage [mV]"],
        dict(time=15.0 * np.arange(121), current=current), rng, dict(time=0, current=1, voltage=1),
    )  # fmt: skip
    rng = np.random.default_rng(14)
    voltage = levels(rng, 101, 5, 14, [-12.0, 0.0, 6.0, 12.0, 18.0])
    voltage[:5] = 0.0
    write(
        "dc_motor", "steps", ["time [ms]", "voltage [V]", "current [mA]", "speed [rpm]"],
        dict(time=2.0 * np.arange(101), voltage=voltage), rng, dict(time=0, voltage=0, current=0, speed=1),
    )  # fmt: skip
    rng = np.random.default_rng(15)
    minutes = np.array([0, 2, 4, 6, 8, 10, 13, 16, 20, 25, 30, 30, 35, 40, 50, 60.0])
    for run in ("cool", "hot"):
        write(
            "reaction", run, ["time [min]", *(f"{name} [mol/dm3]" for name in "ABC")],
            dict(time=minutes), rng, dict(time=0, A=4, B=4, C=4),
            lambda column, k: column == "C" and k % 2 == 0,
        )  # fmt: skip
    rng = np.random.default_rng(16)
    hours = np.array([0, 0.25, 0.5, 1, 1.5, 2, 3, 5, 7, 9, 12, 24.0])
    for run in PROBLEMS["drug"].runs.split():
        write(
            "drug", run, ["time [h]", "concentration [mg/dm3]", "sd [mg/dm3]"],
            dict(time=hours), rng, dict(time=2, concentration=2, sd=2), lambda _, k: k == 0,
        )  # fmt: skip


if __name__ == "__main__":
    main()
