"""Stiff problems with few samples, and their optima by SciPy.

Prints what is committed as crates/estimation/tests/stiff.json: for each problem its model file, its data, the noise of
each signal, and the least sum of squares of the residuals over their standard deviations, with the parameters there.
Data are solutions with known parameters and Gauss's noise. Solutions are those of Radau IIA with a relative tolerance
of 1e-10; the optimum is that of a trust region from the known parameters.

    python3 tests/python/stiff_reference.py > crates/estimation/tests/stiff.json
"""

import json
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

SEED = 7


class Problem(NamedTuple):
    """A system, how the fit is to begin, and what is measured."""

    right: callable
    equations: dict[str, tuple[float, str]]
    truth: dict[str, float]
    start: dict[str, float]
    times: list[float]
    noise: dict[str, float]


def robertson(k1, k2, k3):
    """H. H. Robertson, The solution of a set of reaction rate equations, 1966."""
    return lambda _, x: [
        -k1 * x[0] + k3 * x[1] * x[2],
        k1 * x[0] - k3 * x[1] * x[2] - k2 * x[1] ** 2,
        k2 * x[1] ** 2,
    ]


def binding(on, off, decay):
    """A and B bind fast to C, which decays slowly."""

    def right(_, x):
        rate = on * x[0] * x[1] - off * x[2]
        return [-rate, -rate, rate - decay * x[2]]

    return right


def hires(k1, k2, k3, k6):
    """High irradiance responses of photomorphogenesis (Hairer & Wanner II, section IV.10)."""
    return lambda _, y: [
        -k1 * y[0] + k2 * y[1] + k3 * y[2] + 0.0007,
        k1 * y[0] - 8.75 * y[1],
        -10.03 * y[2] + k2 * y[3] + 0.035 * y[4],
        8.32 * y[1] + k1 * y[2] - 1.12 * y[3],
        -1.745 * y[4] + k2 * y[5] + k2 * y[6],
        -k6 * y[5] * y[7] + 0.69 * y[3] + k1 * y[4] - k2 * y[5] + 0.69 * y[6],
        k6 * y[5] * y[7] - 1.81 * y[6],
        -k6 * y[5] * y[7] + 1.81 * y[6],
    ]


PROBLEMS = {
    "robertson": Problem(
        robertson,
        {
            "a": (1.0, "-k1 * a + k3 * b * c"),
            "b": (0.0, "k1 * a - k3 * b * c - k2 * b^2"),
            "c": (0.0, "k2 * b^2"),
        },
        {"k1": 0.04, "k2": 3e7, "k3": 1e4},
        {"k1": 0.1, "k2": 1e7, "k3": 2e4},
        [0.0, *(0.4 * 10.0**k for k in range(6))],
        {"a": 1e-3, "b": 1e-7, "c": 1e-3},
    ),
    "binding": Problem(
        binding,
        {
            "a": (1.0, "-(on * a * b - off * c)"),
            "b": (0.8, "-(on * a * b - off * c)"),
            "c": (0.0, "on * a * b - off * c - decay * c"),
        },
        {"on": 1e3, "off": 1.0, "decay": 0.05},
        {"on": 300.0, "off": 3.0, "decay": 0.02},
        [0.0, 0.001, 0.01, 0.1, 1.0, 5.0, 10.0, 20.0, 40.0],
        {"a": 1e-2, "b": 2e-4, "c": 1e-2},
    ),
    "hires": Problem(
        hires,
        {
            "y1": (1.0, "-k1 * y1 + k2 * y2 + k3 * y3 + 0.0007"),
            "y2": (0.0, "k1 * y1 - 8.75 * y2"),
            "y3": (0.0, "-10.03 * y3 + k2 * y4 + 0.035 * y5"),
            "y4": (0.0, "8.32 * y2 + k1 * y3 - 1.12 * y4"),
            "y5": (0.0, "-1.745 * y5 + k2 * y6 + k2 * y7"),
            "y6": (0.0, "-k6 * y6 * y8 + 0.69 * y4 + k1 * y5 - k2 * y6 + 0.69 * y7"),
            "y7": (0.0, "k6 * y6 * y8 - 1.81 * y7"),
            "y8": (0.0057, "-k6 * y6 * y8 + 1.81 * y7"),
        },
        {"k1": 1.71, "k2": 0.43, "k3": 8.32, "k6": 280.0},
        {"k1": 1.0, "k2": 0.8, "k3": 5.0, "k6": 100.0},
        [0.0, 1.0, 3.0, 10.0, 30.0, 60.0, 100.0, 150.0, 200.0, 250.0, 300.0, 310.0, 320.0],
        {"y1": 0.01, "y4": 0.005, "y6": 0.01, "y7": 1e-4},
    ),
}


def measured(problem, parameters):
    """The measured states at the samples, one row for each."""
    initial = [start for start, _ in problem.equations.values()]
    right = problem.right(*parameters)
    span = (0, problem.times[-1])
    settings = dict(method="Radau", t_eval=problem.times, rtol=1e-10, atol=1e-14)
    run = solve_ivp(right, span, initial, **settings)
    assert run.success, run.message
    names = list(problem.equations)
    return np.array([run.y[names.index(name)] for name in problem.noise])


def model(name, problem):
    """The model file."""
    lines = ["[model]", f'name = "{name}"', "[parameters]"]
    lines += [f"{key} = {{ start = {value!r}, min = 0 }}" for key, value in problem.start.items()]
    lines += ["[states]"]
    for key, (start, right) in problem.equations.items():
        lines.append(f'{key} = {{ start = {start!r}, der = "{right}" }}')
    return "\n".join(lines) + "\n"


def solved(name, problem):
    """What is committed of a problem."""
    truth = np.array(list(problem.truth.values()))
    deviations = np.array(list(problem.noise.values()))[:, None]
    noise = np.random.default_rng(SEED).standard_normal((len(deviations), len(problem.times)))
    data = measured(problem, truth) + deviations * noise
    residuals = lambda logarithms: ((data - measured(problem, np.exp(logarithms))) / deviations).ravel()
    settings = dict(jac="3-point", diff_step=1e-4, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    best = least_squares(residuals, np.log(truth), **settings)
    return {
        "model": model(name, problem),
        "time": problem.times,
        "data": dict(zip(problem.noise, data.tolist())),
        "noise": problem.noise,
        "objective": 2 * best.cost,
        "parameters": dict(zip(problem.truth, np.exp(best.x).tolist())),
    }


if __name__ == "__main__":
    print(json.dumps({name: solved(name, own) for name, own in PROBLEMS.items()}, indent=1))
