"""`pilotage optimise` against CasADi and IPOPT on the problems of examples/optimal_control: the same Hermite-Simpson
transcription with the midpoints as unknowns, mesh, scales, start and tolerance, one start, one thread. From the repository's root:

    python3 benches/ipopt/optimal.py                      all problems
    python3 benches/ipopt/optimal.py goddard hang_glider  these
    python3 benches/ipopt/optimal.py --command target/quick/pilotage

It makes a virtual environment with CasADi in .venv/casadi. Seconds are those of a solve, on one thread: functions are built before.
Ours are those of the clock, IPOPT's those of the processor, which are no more. The exit code is 1 where both converge to objectives that differ by more than 1e-6.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "casadi"))

import environment

environment.enter()

import casadi as ca
import numpy as np

INF = float("inf")
RUNS = 5


class Problem:
    """States begin at `first`, end at `last` where that is a number, and are guessed along lines to `guess`; `bounds` hold
    along the path, `last_bounds` at its end. They are divided by `sizes`. `duration` is a number, or start, least and largest."""

    def __init__(self, rates, first, last, guess, controls, duration, objective, intervals, bounds=(), sign=1,
                 last_bounds=(), sizes=None):
        self.rates, self.first, self.last, self.guess = rates, first, last, guess
        self.controls, self.duration, self.objective = controls, duration, objective
        self.intervals, self.bounds, self.sign = intervals, dict(bounds), sign
        self.last_bounds = dict(last_bounds)
        self.sizes = sizes or [max(abs(a), abs(b)) or 1.0 for a, b in zip(first, guess)]


def bead(x, u):
    return [x[2] * ca.sin(u[0]), x[2] * ca.cos(u[0]), 9.81 * ca.cos(u[0])]


def cart(x, u):
    return [x[1], u[0]]


def pushed(x, u):
    return [x[1], u[0], 0.5 * u[0] ** 2]


def oscillator(x, u):
    return [(1 - x[1] ** 2) * x[0] - x[1] + u[0], x[0], x[0] ** 2 + x[1] ** 2 + u[0] ** 2]


def rocket(x, u):
    drag = 310 * x[1] ** 2 * ca.exp(-500 * (x[0] - 1))
    return [x[1], (u[0] - drag) / x[2] - 1 / x[0] ** 2, -u[0] / 0.5]


def particle(x, u):
    return [x[2], x[3], 100 * ca.cos(u[0]), 100 * ca.sin(u[0])]


def catalyst(x, u):
    return [u[0] * (10 * x[1] - x[0]), u[0] * (x[0] - 10 * x[1]) - (1 - u[0]) * x[1]]


def glider(x, u):
    r = (x[0] / 100 - 2.5) ** 2
    w = x[3] - 2.5 * (1 - r) * ca.exp(-r)
    v = ca.sqrt(x[2] ** 2 + w**2)
    lift = 0.5 * u[0] * 1.13 * 14 * v**2
    drag = 0.5 * (0.034 + 0.069662 * u[0] ** 2) * 1.13 * 14 * v**2
    return [x[2], x[3], (-lift * w / v - drag * x[2] / v) / 100, (lift * x[2] / v - drag * w / v) / 100 - 9.80665]


def arm(x, u):
    i_phi = ((5 - x[0]) ** 3 + x[0] ** 3) / 3
    return [x[1], u[0] / 5, x[3], u[1] / (i_phi * ca.sin(x[4]) ** 2), x[5], u[2] / i_phi]


def tumour(x, u):
    return [-0.084 * x[0] * ca.log(x[0] / x[1]), x[1] * (5.83 - 0.00873 * x[0] ** (2 / 3) - 0.15 * u[0]), u[0]]


QUARTER = np.pi / 4
LARGEST = (5.83 / 0.00873) ** 1.5
PROBLEMS = {
    "brachistochrone": Problem(bead, [0, 0, 0], [2, 2, None], [2, 2, 0], [(0, 3.14159, 1)], (1, 0.1, 10), lambda x, t: t, 30),
    "bounded_double_integrator": Problem(
        pushed, [0, 1, 0], [0, -1, None], [0, -1, 0], [(-INF, INF, 0)], 1, lambda x, t: x[2], 60, {0: (-INF, 1 / 9)}
    ),
    "minimum_time_cart": Problem(cart, [0, 0], [300, 0], [300, 0], [(-2, 1, -0.5)], (20, 1, 100), lambda x, t: t, 40),
    "van_der_pol": Problem(oscillator, [0, 1, 0], [None] * 3, [0, 1, 5], [(-0.3, 1, 0)], 5, lambda x, t: x[2], 50),
    "goddard": Problem(
        rocket, [1, 0, 1], [None, None, 0.6], [1.01, 0.05, 0.6], [(0, 3.5, 1.75)], (0.2, 0.01, 2), lambda x, t: -x[0], 100,
        {1: (0, INF)}, -1,
    ),
    "particle_steering": Problem(
        particle, [0] * 4, [None, 5, 45, 0], [0, 5, 45, 0], [(-np.pi / 2, np.pi / 2, 0)], (1, 0.01, 10), lambda x, t: t, 50
    ),
    "catalyst_mixing": Problem(
        catalyst, [1, 0], [None] * 2, [1, 0], [(0, 1, 0.5)], 1, lambda x, t: -1 + x[0] + x[1], 100
    ),
    "hang_glider": Problem(
        glider, [0, 1000, 13.23, -1.288], [None, 900, 13.23, -1.288], [1300, 900, 13.23, -1.288], [(0, 1.4, 0.7)],
        (100, 10, 300), lambda x, t: -x[0], 100, {0: (0, INF), 2: (0, INF)}, -1,
    ),
    "robot_arm": Problem(
        arm, [4.5, 0, 0, 0, QUARTER, 0], [4.5, 0, 2 * np.pi / 3, 0, QUARTER, 0], [4.5, 0, 2 * np.pi / 3, 0, QUARTER, 0],
        [(-1, 1, 0)] * 3, (10, 1, 50), lambda x, t: t, 50, {0: (0, 5)},
    ),
    "tumour": Problem(
        tumour, [LARGEST / 2, LARGEST / 4, 0], [None] * 3, [LARGEST / 2, LARGEST / 4, 0], [(0, 75, 10)], (1, 0.1, 10),
        lambda x, t: x[0], 60, last_bounds={2: (-INF, 15)}, sizes=[10000, 10000, 10],
    ),
}


def transcribed(own):
    """The program, its limits and its start; variables are divided by their sizes."""
    n, m, count = len(own.first), len(own.controls), own.intervals
    sizes = np.array(own.sizes, dtype=float)
    widths = np.array([max((abs(v) for v in c if abs(v) < INF), default=0) or 1.0 for c in own.controls])
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
    rates = ca.Function("rates", [x, u], [ca.vertcat(*own.rates(x * sizes, u * widths)) / sizes])
    variables, lower, upper, start = [], [], [], []

    def add(name, size, low, high, begin):
        variables.append(ca.SX.sym(name, size))
        lower.extend(low), upper.extend(high), start.extend(begin)
        return variables[-1]

    is_free = isinstance(own.duration, tuple)
    if is_free:
        scale, low, high = own.duration
        seconds = scale * add("t", 1, [low / scale], [high / scale], [1])
    else:
        seconds = own.duration

    def state(part):
        low, high = np.full(n, -INF), np.full(n, INF)
        for k, limits in own.bounds.items():
            low[k], high[k] = np.array(limits) / sizes[k]
        if part == 0:
            low = high = np.array(own.first) / sizes
        if part == 1:
            for k, limits in own.last_bounds.items():
                low[k], high[k] = np.array(limits) / sizes[k]
            for k, value in enumerate(own.last):
                if value is not None:
                    low[k] = high[k] = value / sizes[k]
        begin = (np.array(own.first) + part * (np.array(own.guess, dtype=float) - np.array(own.first))) / sizes
        return add("x", n, low, high, begin)

    low, high, begin = (np.array(v) / widths for v in zip(*own.controls))
    control = lambda: add("u", m, low, high, begin)
    equal, h = [], 1 / count
    a, ua = state(0), control()
    for k in range(count):
        middle, b, ub = state((k + 0.5) / count), state((k + 1) / count), control()
        fa, fb = rates(a, ua) * seconds, rates(b, ub) * seconds
        fm = rates(middle, (ua + ub) / 2) * seconds
        equal += [middle - (a + b) / 2 - h / 8 * (fa - fb), b - a - h / 6 * (fa + 4 * fm + fb)]
        a, ua = b, ub
    objective = own.objective(a * sizes, seconds)
    nlp = {"x": ca.vertcat(*variables), "f": objective, "g": ca.vertcat(*equal)}
    return nlp, {"x0": start, "lbx": lower, "ubx": upper, "lbg": 0, "ubg": 0}


def ipopt(own):
    nlp, limits = transcribed(own)
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-8, "max_iter": 2000, "max_cpu_time": 120.0}}
    solver = ca.nlpsol("solver", "ipopt", nlp, options)
    seconds = INF
    for _ in range(RUNS):
        clock = time.process_time()
        found = solver(**limits)
        seconds = min(seconds, time.process_time() - clock)
    stats = solver.stats()
    return stats["success"], stats["iter_count"], seconds, own.sign * float(found["f"])


def ours(command, name):
    """The least of a few runs; one start is on one thread."""
    file = ROOT / "examples" / "optimal_control" / f"{name}.toml"
    words = [command, "optimise", file, "--no-refinement", "--starts", "1", "--json"]
    runs = [json.loads(subprocess.run(words, capture_output=True, text=True).stdout) for _ in range(RUNS)]
    start = runs[0]["starts"][0]
    seconds = min(run["starts"][0]["seconds"] for run in runs)
    return start["status"] == "converged", start["iterations"], seconds, runs[0]["objective"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="PROBLEM", help=", ".join(PROBLEMS))
    parser.add_argument("--command", default="pilotage", help="the command, if it is not on the path")
    given = parser.parse_args()
    print(f"{'problem':26} | ours: iter.  seconds     objective | IPOPT: iter.  seconds     objective | ratio")
    ratios, differ = [], False
    for name in given.names or PROBLEMS:
        own, peer = ours(given.command, name), ipopt(PROBLEMS[name])
        ratio = peer[2] / own[2]
        ratios.append(ratio)
        status = lambda found: "" if found[0] else " not converged"
        differ |= own[0] and peer[0] and abs(own[3] - peer[3]) > 1e-6 * max(abs(peer[3]), 1e-3)
        print(
            f"{name:26} | {own[1]:11} {own[2]:8.4f} {own[3]:13.8f} | {peer[1]:12} {peer[2]:8.4f} {peer[3]:13.8f} | "
            f"{ratio:5.1f}{status(own)}{status(peer)}"
        )
    print(f"median ratio {statistics.median(ratios):.1f}, least {min(ratios):.1f}")
    return int(differ)


if __name__ == "__main__":
    sys.exit(main())
