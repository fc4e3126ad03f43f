"""Checks the describing function of `pilotage fit --json` with NumPy's FFT; prints the largest relative differences.

usage: describing.py FIT.json RUN.csv...
Runs are whole periods and one sample; all have the same lines, those above a thousandth of the target's power.
"""

import json
import sys

import numpy as np

told = json.load(open(sys.argv[1]))["describing_function"]
runs = []
for path in sys.argv[2:]:
    lines = [line for line in open(path) if not line.startswith("#")]
    names = [name.split(" [")[0] for name in lines[0].strip().split(",")]
    runs.append(dict(zip(names, np.genfromtxt(lines[1:], delimiter=",").T)))


def spectra(run):
    """Amplitudes of target, error, stick and position over the last whole period."""
    signals = [run["target"], run["target"] - run["position"], run["stick"], run["position"]]
    n = len(run["time"]) - 1
    return np.array([2 / n * np.fft.fft(own[1:] - own[1:].mean())[:n // 2] for own in signals])


step = runs[0]["time"][1] - runs[0]["time"][0]
spacing = 2 * np.pi / (len(runs[0]["time"]) - 1) / step
all_spectra = [spectra(run) for run in runs]
power = abs(all_spectra[0][0]) ** 2
lines = np.flatnonzero(power > 1e-3 * power.max())


def line(own, k):
    """The line without its transient, a parabola through the eight nearest bins; what is left of these; the leverage."""
    beside = sorted((b for b in range(1, own.shape[1]) if b not in lines), key=lambda b: abs(b - k))[:8]
    x = np.vander(np.array(beside) - k, 3, increasing=True)
    coefficients = np.linalg.lstsq(x, own[:, beside].T, rcond=None)[0]
    return own[:, k] - coefficients[0], own[:, beside].T - x @ coefficients, 1 + np.linalg.inv(x.T @ x)[0, 0]


def expected(k, output):
    values, left, leverage = zip(*(line(own, k) for own in all_spectra))
    f, e, u = np.array(values)[:, [0, 1, output]].T
    response = np.vdot(f, u) / np.vdot(f, e)
    slope = np.vdot(f, u) / np.vdot(f, f)
    remnant, noise = (noise_of(left, leverage, weights, output) for weights in
                      [(u - response * e, 1, response), (u - slope * f, 1, 0)])
    sd = np.sqrt(remnant * (np.array(leverage) * abs(f) ** 2).sum() / 2) / abs(np.vdot(f, e)) / abs(response)
    # The slope has so much by chance.
    variance = noise * (np.array(leverage) * abs(f) ** 2).sum() / (abs(f) ** 2).sum() ** 2
    coherent = max(abs(slope) ** 2 - variance, 0) * (abs(f) ** 2).mean()
    return {"frequency_rad_per_s": k * spacing, "gain": abs(response), "gain_sd": sd * abs(response),
            "phase_sd_deg": np.degrees(sd), "coherence": coherent / (coherent + noise),
            "remnant_density": remnant / 2 / spacing, "amplitude": np.sqrt((abs(f) ** 2).mean()), "phase": response}


def noise_of(left, leverage, weights, output):
    at_line, one, other = weights
    between = sum((abs(own[:, output] * one - other * own[:, 1]) ** 2).sum() for own in left) / (5 * len(left))
    scatter = (abs(at_line) ** 2 / leverage).sum() / (len(left) - 1) if len(left) > 1 else 0
    return max(between, scatter) if len(left) > 2 else between


worst = {}
for name, output in [("pilot", 2), ("open_loop", 3)]:
    own = told[name]
    assert len(own["gain"]) == len(lines), (own["frequency_rad_per_s"], lines * spacing)
    for j, k in enumerate(lines):
        right = expected(k, output)
        turned = right.pop("phase") / np.exp(1j * np.radians(own["phase_deg"][j]))
        errors = {key: abs(own[key][j] / value - 1) for key, value in right.items()} | {"phase": abs(np.angle(turned))}
        for key, error in errors.items():
            worst[key] = max(worst.get(key, 0), float(error))
print(json.dumps(worst))
