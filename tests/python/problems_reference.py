"""The optima of examples/problems, by SciPy, with equations written by hand.

Prints what is committed as tests/it/problem_examples.json: for each problem the least value of

    sum over runs, measured signals and samples of ((y - h) / sd)^2, plus 2 ln sd where an sd is sought,
    plus ((p - mean) / sd)^2 for a prior,

the squares of the data alone (chi2), how many samples there are, what was sought, and its standard deviations (sd):
plain, s^2 (J'J)^-1, and by the autocorrelations of the residuals (sidpac) up to a fifth of each run. Values are in the units of the
models. Of the problem files the start values are read, and nothing else; data are read and converted by their headers.

States are integrated from row to row in fixed steps of order 8; derivatives are those of the discrete map by complex
steps. A trust region goes to the optimum, Newton's method to its last digits. What is printed is checked by an
adaptive integration with relative tolerance 1e-13 and by another optimiser from another start.

    python3 tests/python/problems_reference.py > tests/it/problem_examples.json
"""

import csv
import json
import re
import tomllib
from math import ceil, inf, pi
from pathlib import Path
from typing import Callable, NamedTuple

import numpy as np
from numpy import exp, log
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import minimize

FOLDER = Path(__file__).parents[2] / "examples/problems"
# Of the units in the headers: factors to those of the models.
UNITS = {
    "ms": 1e-3,
    "mA": 1e-3,
    "mV": 1e-3,
    "rpm": 2 * pi / 60,
    "min": 60.0,
    "h": 3600.0,
    "mol/dm3": 1e3,
} | dict.fromkeys(["s", "A", "V", "mg/dm3", "1"], 1.0)


STAGES = [np.array(DOP853.A[k, :k], complex) for k in range(12)]
WEIGHTS = np.array(DOP853.B, complex)


def step(right, x, h):
    """One step of Dormand and Prince's method of order 8."""
    slopes = np.zeros((12, *x.shape), complex)
    flat = slopes.reshape(12, -1)
    slopes[0] = right(x)
    for k in range(1, 12):
        slopes[k] = right(x + h * (STAGES[k] @ flat[:k]).reshape(x.shape))
    return x + h * (WEIGHTS @ flat).reshape(x.shape)


def fixed(right, x, span, longest):
    """The state after a time span, in equal steps."""
    count = ceil(span / longest)
    for _ in range(count):
        x = step(right, x, span / count)
    return x


def adaptive(right, x, span, _):
    """The same with error control."""
    settings = dict(method="DOP853", rtol=1e-13, atol=1e-15, first_step=span / 8)
    flat = lambda _, state: right(state.reshape(x.shape)).ravel()
    run = solve_ivp(flat, (0, span), x.ravel(), **settings)
    assert run.success, run.message
    return run.y[:, -1].reshape(x.shape)


def trajectory(right, start, times, longest, advance, inputs=None):
    """States at each row. Inputs hold from their row to the next; what is unknown comes in columns."""
    shape = np.broadcast_shapes(*(np.shape(value) for value in start))
    x = [np.array([np.broadcast_to(value, shape) for value in start], complex)]
    for k, span in enumerate(np.diff(times)):
        now = right if inputs is None else lambda x: right(x, inputs[k])
        x.append(advance(now, x[-1], span, longest) if span else x[-1])
    return np.array(x).swapaxes(0, 1)


def curve(name, at):
    """Straight lines between the points of a table."""
    columns = read(name)
    x, y = columns.values()
    k = np.clip(np.searchsorted(x, at.real, "right") - 1, 0, len(x) - 2)
    return y[k] + (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (at - x[k])


def hare_lynx(p, run, columns, advance):
    right = lambda x: np.array([
        (p["wild.birth"] - p["wild.predation"] * x[1]) * x[0],
        (p["wild.benefit"] * x[0] - p["wild.death"]) * x[1],
    ])
    start = p["wild.prey"], p["wild.predators"]
    hares, lynx = trajectory(right, start, columns["time"], 0.1, advance)
    return {"hares": (hares, 5), "lynx": (lynx, 4)}


def van_der_pol(p, run, columns, advance):
    right = lambda x: np.array([x[1], p["oscillator.mu"] * (1 - x[0] ** 2) * x[1] - x[0]])
    x, _ = trajectory(right, (1.0, p["oscillator.v"]), columns["time"], 0.04, advance)
    return {"reading": (p["oscillator.x gain"] * x, 0.1)}


def fitzhugh_nagumo(p, run, columns, advance):
    a, b, c = p["cell.a"], p["cell.b"], p["cell.c"]
    right = lambda x: np.array([c * (x[0] - x[0] ** 3 / 3 + x[1]), -(x[0] - a + b * x[1]) / c])
    start = -1.0 + 0 * a, 1.0
    voltage, recovery = trajectory(right, start, columns["time"], 0.04, advance)
    return {"voltage": (voltage, p["sigma"]), "recovery": (recovery, p["sigma"])}


def battery(p, run, columns, advance):
    r0, r1, c1 = p["cell.r0"], p["cell.r1"], p["cell.c1"]
    right = lambda x, i: np.array([0 * x[0] - i / (3600 * 2.5), i / c1 - x[1] / (r1 * c1)])
    i, start = columns["current"], (p["cell.charge"], 0.0)
    charge, slow = trajectory(right, start, columns["time"], 7.5, advance, i)
    voltage = curve("battery/open_circuit.csv", charge) - slow - r0 * i[:, None]
    return {"voltage": (voltage, 0.002)}


def dc_motor(p, run, columns, advance):
    r, l, k, j, b = (
        p["motor." + name] for name in "resistance inductance constant inertia friction".split()
    )
    right = lambda x, u: np.array([(u - r * x[0] - k * x[1]) / l, (k * x[0] - b * x[1]) / j])
    inputs, start = columns["voltage"], (0 * r, 0.0)
    current, speed = trajectory(right, start, columns["time"], 5e-4, advance, inputs)
    return {"current": (current + p["motor.current offset"], 0.08), "speed": (speed, 1.0)}


def reaction(p, run, columns, advance):
    temperature = {"cool": 318.0, "hot": 342.0}[run]
    hotter = (1 / 330 - 1 / temperature) / 8.31446261815324
    k1 = p["reactor.k1"] * exp(p["reactor.e1"] * hotter)
    k2 = p["reactor.k2"] * exp(p["reactor.e2"] * hotter)
    right = lambda x: np.array([-k1 * x[0], k1 * x[0] - k2 * x[1], k2 * x[1]])
    start = p[f"filled {run}.csv"], 0.0, 0.0
    a, b, c = trajectory(right, start, columns["time"], 60.0, advance)
    return {"A": (a, 15), "B": (b, 15), "C": (c, 25)}


def drug(p, run, columns, advance):
    subject = run.split("_")[0].capitalize()
    dose = 160.0 if run == "anna_again" else 320.0
    volume = p["specific_volume"] * {"Anna": 58.0, "Bert": 91.0, "Cleo": 66.0}[subject]
    absorbed, cleared = p["body.absorption"] / 3600, p["body.clearance " + subject] / 3600 / volume
    right = lambda x: np.array([-absorbed * x[0], absorbed * x[0] - cleared * x[1]])
    _, blood = trajectory(right, (dose + 0 * volume, 0.0), columns["time"], 450.0, advance)
    return {"concentration": (blood / volume, columns["sd"][:, None])}


class Problem(NamedTuple):
    """What was measured, and what is sought: names with what they are of a run, a subject or a sensor."""

    simulate: Callable  # measured columns with their sd, in the units of the model
    runs: str
    parameters: str
    initial: str = ""
    sensors: str = ""
    priors: dict = {}  # name: mean and sd

    def names(self):
        text = ",".join([self.parameters, self.initial, self.sensors])
        return [name.strip() for name in text.split(",") if name.strip()]


PROBLEMS = {
    "hare_lynx": Problem(
        hare_lynx,
        "pelts",
        "wild.birth, wild.predation, wild.death, wild.benefit",
        "wild.prey, wild.predators",
    ),
    "van_der_pol": Problem(
        van_der_pol, "oscillation", "oscillator.mu", "oscillator.v", "oscillator.x gain"
    ),
    "fitzhugh_nagumo": Problem(fitzhugh_nagumo, "spikes", "cell.a, cell.b, cell.c, sigma"),
    "battery": Problem(battery, "drive", "cell.r0, cell.r1, cell.c1", "cell.charge"),
    "dc_motor": Problem(
        dc_motor,
        "steps",
        "motor.resistance, motor.inductance, motor.constant, motor.inertia, motor.friction",
        sensors="motor.current offset",
    ),
    "reaction": Problem(
        reaction,
        "cool hot",
        "reactor.k1, reactor.k2, reactor.e1, reactor.e2, filled cool.csv, filled hot.csv",
    ),
    "drug": Problem(
        drug,
        "anna anna_again bert cleo",
        "body.absorption, body.clearance Anna, body.clearance Bert, body.clearance Cleo,"
        "specific_volume",
        priors={"specific_volume": (0.5, 0.03)},
    ),
}


def read(name):
    """Columns of a CSV file in the units of the models; what is empty is not a number."""
    header, *rows = csv.reader((FOLDER / name).read_text().splitlines())
    columns = {}
    for title, *cells in zip(header, *rows):
        column, _, unit = re.fullmatch(r"(\w+)( \[(.*)\])?", title).groups()
        values = np.array([float(cell) if cell else np.nan for cell in cells])
        columns[column] = values * UNITS[unit or "1"]
    return columns


def starts(name):
    """Where the search begins, by the problem file and the models that it names."""
    tables = tomllib.loads((FOLDER / name / "problem.toml").read_text())

    def start(label):
        word = label.split()[0]
        if label.endswith((" gain", " offset")):
            return 1.0 if label.endswith("gain") else 0.0
        if word in tables["parameters"]:
            return float(tables["parameters"][word]["start"])
        instance, state = word.split(".")
        model = tomllib.loads((FOLDER / name / tables["system"][instance]["model"]).read_text())
        return float(model["states"][state].get("start", 0))

    return np.array([start(label) for label in PROBLEMS[name].names()])


class Fit:
    """The objective of a problem over its scaled unknowns, with derivatives."""

    def __init__(self, name):
        self.problem = PROBLEMS[name]
        self.data = {run: read(f"{name}/{run}.csv") for run in self.problem.runs.split()}
        self.start = starts(name)
        self.scale = np.where(self.start, abs(self.start), 1.0)

    def terms(self, z, advance):
        """Measured values, predictions and sd, one row for each sample, one column for each of z."""
        p = dict(zip(self.problem.names(), self.scale[:, None] * z))
        for run, columns in self.data.items():
            for name, (h, sd) in self.problem.simulate(p, run, columns, advance).items():
                y = columns[name][:, None]
                measured = ~np.isnan(y[:, 0])
                yield tuple(np.broadcast_to(part, h.shape)[measured] for part in (y, h, sd))

    def value(self, z, advance=fixed):
        """The objective of each column, the squares of the data, and the number of samples."""
        chi2 = logs = count = 0
        for y, h, sd in self.terms(z, advance):
            chi2 = chi2 + (((y - h) / sd) ** 2).sum(0)
            logs = logs + 2 * log(sd).sum(0)
            count += len(y)
        objective = chi2 + ("sigma" in self.problem.names()) * logs
        for name, (mean, sd) in self.problem.priors.items():
            k = self.problem.names().index(name)
            objective = objective + ((self.scale[k] * z[k] - mean) / sd) ** 2
        return objective, chi2, count

    def gradients(self, points, advance=fixed):
        """The gradient at each of the points (rows), by complex steps; and the values there."""
        tiny, (many, n) = 1e-30, points.shape
        z = points[:, :, None] + 1j * tiny * np.eye(n)
        objective = self.value(z.swapaxes(0, 1).reshape(n, -1), advance)[0].reshape(many, n)
        return objective.imag / tiny, objective.real[:, 0]

    def gradient(self, z, advance=fixed):
        return self.gradients(z[None], advance)[0][0]

    def hessian(self, z):
        """Central differences of the gradient."""
        h = 1e-5
        offsets = h * np.eye(len(z))
        ahead, behind = np.split(self.gradients(np.vstack([z + offsets, z - offsets]))[0], 2)
        rows = (ahead - behind) / (2 * h)
        return (rows + rows.T) / 2

    def objective(self, z):
        """Value and gradient; infinite where an sd is negative or the states overflow."""
        if "sigma" in self.problem.names() and z[-1] <= 0:
            return inf, np.zeros(len(z))
        gradient, value = self.gradients(z[None])
        finite = np.isfinite(value[0])
        return (value[0], gradient[0]) if finite else (inf, np.zeros(len(z)))

    def optimum(self):
        """From the start values of the problem file by a trust region, then Newton's method."""
        z = self.start / self.scale
        options = dict(initial_trust_radius=0.1, max_trust_radius=0.5, gtol=1e-2)
        derivatives = dict(jac=True, hess=self.hessian)
        z = minimize(self.objective, z, method="trust-exact", options=options, **derivatives).x
        for _ in range(3):
            z = z - np.linalg.solve(self.hessian(z), self.gradient(z))
        return z

    def rows(self, z):
        """For each run and signal residuals and their derivatives, both in standard deviations; those of a noise level
        that is sought by its Fisher information, 2 for each value."""
        tiny = 1e-30
        for y, h, sd in self.terms(z[:, None] + 1j * tiny * np.eye(len(z)), fixed):
            level = sd.real[:, :1]
            e = ((y - h.real) / level)[:, 0]
            yield e, h.imag / tiny / level
            if "sigma" in self.problem.names():
                yield (e**2 - 1) / 2**0.5, 2**0.5 * sd.imag / tiny / level

    def deviations(self, z):
        """Standard deviations of the unknowns, plain and with the residuals' autocorrelations."""
        signals = {}
        of_run = len(list(self.rows(z))) // len(self.data)
        for k, row in enumerate(self.rows(z)):
            signals.setdefault(k % of_run, []).append(row)
        prior = np.zeros((len(z), len(z)))
        for name, (_, sd) in self.problem.priors.items():
            k = self.problem.names().index(name)
            prior[k, k] = (self.scale[k] / sd) ** 2
        every = [row for rows in signals.values() for row in rows]
        information = sum(j.T @ j for _, j in every)
        count = sum(len(e) for e, _ in every)
        noise = sum(e @ e for e, _ in every) / (count - len(z))
        if "sigma" in self.problem.names():
            # Half of the rows are those of the level, whose maximum likelihood estimate does not count the unknowns.
            noise = count / 2 / (count / 2 - len(z))
        correlated = sum(colour(rows) for rows in signals.values())
        inverse = np.linalg.inv(information + prior)
        meats = {"plain": noise * information, "sidpac": correlated}
        variances = {name: np.diag(inverse @ (meat + prior) @ inverse) for name, meat in meats.items()}
        return {name: self.scale * np.sqrt(own) for name, own in variances.items()}

    def check(self, name, z):
        """That this is a minimum, by other means than those that found it."""
        hessian, gradient = self.hessian(z), self.gradient(z, adaptive)
        error = abs(np.linalg.solve(hessian, gradient)).max()
        assert np.linalg.eigvalsh(hessian).min() > 0, f"{name}: no minimum"
        assert error < 1e-10, f"{name}: off by {error:.1e}"
        near = z * (1 + 0.03 * np.random.default_rng(1).uniform(-1, 1, len(z)))
        # The metric of its first step is a matter of how many steps it takes.
        metric = np.linalg.inv(hessian)
        options = dict(gtol=1e-4, hess_inv0=(metric + metric.T) / 2)
        other = minimize(self.objective, near, method="BFGS", jac=True, options=options)
        error = abs(other.x - z).max()
        assert error < 1e-6, f"{name}: BFGS ends {error:.1e} beside"


def colour(rows):
    """The sum over i, j of J_i' R(i - j) J_j over the runs of a signal, with the residuals' autocorrelations R."""
    count = sum(len(e) for e, _ in rows)
    total = 0
    for _, j in rows:
        n = len(j)
        lags = abs(np.subtract.outer(np.arange(n), np.arange(n)))
        r = [sum(e[k:] @ e[: len(e) - k] for e, _ in rows) / count for k in range(n // 5 + 1)]
        total = total + j.T @ np.where(lags <= n // 5, np.take(r, lags, mode="clip"), 0) @ j
    return total


def rounded(value):
    return float(f"{value:.11g}")


def result(name):
    """What is printed of a problem."""
    fit = Fit(name)
    z = fit.optimum()
    fit.check(name, z)
    objective, chi2, count = fit.value(z[:, None].astype(complex))
    values = dict(zip(fit.problem.names(), fit.scale * z))
    found = {
        "objective": rounded(objective[0].real),
        "chi2": rounded(chi2[0].real),
        "samples": count,
    }
    deviations = fit.deviations(z)
    found["sd"] = {
        method: dict(zip(fit.problem.names(), map(rounded, own))) for method, own in deviations.items()
    }
    for section in ("parameters", "initial", "sensors"):
        table = {}
        for label in filter(None, getattr(fit.problem, section).split(",")):
            value, (word, *of) = rounded(values[label.strip()]), label.split()
            if of:
                table.setdefault(word, {})[of[0]] = value
            else:
                table[word] = value
        if table:
            found[section] = table
    return found


if __name__ == "__main__":
    print(json.dumps({name: result(name) for name in PROBLEMS}, indent=2))
