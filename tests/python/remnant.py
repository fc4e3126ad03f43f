"""The likelihood of a loop with noise in it, by a textbook Kalman filter; or the data of examples/problems/remnant.

usage: remnant.py RUN.csv...   of the problem in tests/it/tools/remnant.rs; prints objective and innovations as JSON
       remnant.py --data       writes the runs of the example

The system is put together here from transfer functions and block matrices, not from pilotage's equations: Padé's
approximation in companion form, Van Loan's matrix exponential, all signals of a sample in one update.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
from scipy.linalg import block_diag, cholesky, expm, solve_triangular

FOLDER = Path(__file__).parents[2] / "examples/problems/remnant"
GAIN, LEAD, DELAY, OMEGA, ZETA, POWER, COLOUR = 0.125, 1.0, 0.2, 10.0, 0.7, 10.0, 0.5


def companion(numerator, denominator):
    """A state space of a transfer function, coefficients from the highest power."""
    n = len(denominator) - 1
    a = np.zeros((n, n))
    a[:-1, 1:] = np.eye(n - 1)
    a[-1] = -np.array(denominator[::-1][:-1]) / denominator[0]
    b = np.zeros(n)
    b[-1] = 1 / denominator[0]
    numerator = np.concatenate([np.zeros(n + 1 - len(numerator)), numerator])
    d = numerator[0] / denominator[0]
    return a, b, (numerator - d * np.array(denominator))[:0:-1], d


def pade(delay, order):
    """Numerator and denominator of Padé's approximation, from the highest power."""
    f = math.factorial
    c = [f(2 * order - k) * f(order) / (f(2 * order) * f(k) * f(order - k)) for k in range(order + 1)]
    return [[c[k] * (sign * delay) ** k for k in range(order, -1, -1)] for sign in (-1, 1)]


def system(gain, lead, delay, colour, q, gust):
    """F, the column of the target, the density of the noises and H of position and stick."""
    ap, bp, cp, dp = companion(*pade(delay, 3))
    aa, ba, ca, _ = companion([lead, 1], [OMEGA ** -2, 2 * ZETA / OMEGA, 1])
    # Delay 0..2, arm 3..4, remnant 5, position 6, speed 7.
    f = block_diag(ap, aa, [[-1 / colour]], [[0, 1], [0, 0]])
    f[0:3, 6] = -bp * gain
    f[3:5, 0:3] = np.outer(ba, cp)
    f[3:5, 6] = -ba * dp * gain
    f[7, 3:5] = POWER * ca
    f[7, 5] = POWER
    target = np.concatenate([bp * gain, ba * dp * gain, np.zeros(3)])
    density = np.zeros((8, 8))
    density[5, 5] = q / colour ** 2
    density[7, 7] = gust
    h = np.zeros((2, 8))
    h[0, 6] = 1
    h[1, 3:5], h[1, 5] = ca, 1
    return f, target, density, h


def van_loan(f, density, step):
    n = len(f)
    e = expm(np.block([[-f, density], [np.zeros((n, n)), f.T]]) * step)
    phi = e[n:, n:].T
    return phi, phi @ e[:n, n:]


def filtered(rows, theta, deviations):
    """The objective of a run, and for each signal its innovations, whitened in the order of the signals; None where there is
    none."""
    f, column, density, h = system(*theta)
    n = len(f)
    x, p, total, told, last = np.zeros(n), np.zeros((n, n)), 0.0, ([], []), None
    for time, target, *seen in rows:
        if last is not None:
            step = time - last[0]
            phi, noise = van_loan(f, density, step)
            ramp = np.zeros((n + 2, n + 2))
            ramp[:n, :n], ramp[:n, n], ramp[n, n + 1] = f, column, 1
            state = np.concatenate([x, [last[1], (target - last[1]) / step]])
            x, p = (expm(ramp * step) @ state)[:n], phi @ p @ phi.T + noise
        last = (time, target)
        there = [k for k in range(2) if not math.isnan(seen[k])]
        whitened = {}
        if there:
            part = h[there]
            e = np.array(seen)[there] - part @ x
            s = part @ p @ part.T + np.diag(np.array(deviations)[there] ** 2)
            root = cholesky(s, lower=True)
            white = solve_triangular(root, e, lower=True)
            total += 2 * np.log(np.diag(root)).sum() + white @ white
            gain = np.linalg.solve(s, part @ p).T
            x, p = x + gain @ e, p - gain @ s @ gain.T
            whitened = dict(zip(there, white))
        for k in range(2):
            told[k].append(whitened.get(k))
    return total, told


def read(path):
    with open(path) as file:
        lines = [line for line in file if not line.startswith("#")][1:]
    return [[float(cell) if cell.strip() else math.nan for cell in line.split(",")] for line in lines]


def fly(seed, remnant, step=1e-3, duration=30.0, sample=50):
    """Target, position and stick at the samples; the delay is exact, the method Heun's."""
    rng = np.random.default_rng(seed)
    w = 2 * np.pi * np.array([1, 2, 3, 5, 7, 11, 13, 17]) / duration
    size, phase = np.minimum(1, w ** -2), rng.uniform(0, 2 * np.pi, 8)
    count = round(duration / step)
    times = step * sample * np.arange(count // sample + 2)
    knots = (size * (np.sin(np.outer(times, w) + phase) - np.sin(phase))).sum(axis=1)
    keeps, late = math.exp(-step / COLOUR), round(DELAY / step)
    gauss = rng.normal(size=count + 1) * remnant * math.sqrt(1 - keeps ** 2)
    errors, rows, noise, x = [], [], 0.0, np.zeros(4)

    def rates(x, wish):
        pull = OMEGA ** 2 * (wish - x[0]) - 2 * ZETA * OMEGA * x[1]
        return np.array([x[1], pull, x[3], POWER * (x[0] + LEAD * x[1] + noise)])

    for k in range(count + 1):
        knot, part = divmod(k, sample)
        goal = (1 - part / sample) * knots[knot] + part / sample * knots[knot + 1]
        errors.append(goal - x[2])
        if part == 0:
            rows.append((goal, x[2], x[0] + LEAD * x[1] + noise))
        wish = [GAIN * errors[i] if i >= 0 else 0.0 for i in (k - late, k - late + 1)]
        a = rates(x, wish[0])
        x = x + step / 2 * (a + rates(x + step * a, wish[1]))
        noise = keeps * noise + gauss[k]
    return np.array(rows), rng


def write_data():
    for run in range(1, 5):
        # A twentieth of the stick's power is 0.05 of standard deviation.
        rows, rng = fly(run, 0.05)
        with open(FOLDER / f"run{run}.csv", "w") as file:
            file.write("time [s],target [m],position [m],stick\n")
            for k, (goal, position, stick) in enumerate(rows):
                position, stick = position + 0.01 * rng.normal(), stick + 0.002 * rng.normal()
                shown = f"{position:.4f}" if k % 2 == 0 else ""
                file.write(f"{0.05 * k:.2f},{goal:.6f},{shown},{stick:.5f}\n")


if sys.argv[1:] == ["--data"]:
    write_data()
else:
    theta, deviations = (0.1, 0.7, 0.15, 0.3, 1e-3, 0.02), (0.01, 0.002)
    runs = [filtered(read(path), theta, deviations) for path in sys.argv[1:]]
    print(json.dumps({"objective": sum(total for total, _ in runs), "runs": [told for _, told in runs]}))
