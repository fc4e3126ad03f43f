"""Checks margins, poles and their standard deviations with python-control; prints the largest relative differences.

usage: margins.py VEHICLE.toml SHORT.json PROBLEM.json LOOP.json
SHORT.json, PROBLEM.json: `pilotage fit --json` of flights and of a problem file with the linear pilot.
LOOP.json: `pilotage linearize --json` of the pilot of SHORT.json, cut at the stick.
"""

import json
import math
import sys
import tomllib

import control
import numpy as np

with open(sys.argv[1], "rb") as file:
    vehicle = tomllib.load(file)
short, problem, linear = (json.load(open(path)) for path in sys.argv[2:5])


def loop(theta):
    """-N/D times the vehicle about hover, from the coefficients of the vehicle file."""
    v = vehicle
    thrust = v["mass"] * v["gravity"] / v["hover_speed"]
    beta = math.sqrt(2) * v["arm_length"] / v["inertia"] * thrust * v["propeller_gain"]
    pitch = [1, v["propeller_lag"], beta * v["rate_gain"], beta * v["attitude_gain"]]
    n = len(theta) // 2
    pilot = control.tf(list(theta[:n - 1:-1]), [1, *theta[n - 1::-1]])
    gain = v["gravity"] * v["max_pitch"] * pitch[-1]
    return -pilot * control.tf([gain], [*pitch, 0, 0])


def figures(theta):
    L = loop(theta)
    gain_margin, phase_margin, _, phase_frequency, gain_frequency = crossings(L)
    return {
        "crossover_frequency": gain_frequency,
        "phase_margin": phase_margin,
        "effective_delay": (math.pi / 2 - math.radians(phase_margin)) / gain_frequency,
        "gain_margin": 20 * math.log10(gain_margin),
    }


def crossings(L):
    gain, phase, stability, wp, wg, _ = control.stability_margins(L)
    return gain, phase, stability, wp, wg


def slopes(theta, sd):
    """Richardson's extrapolation of central differences."""
    columns = []
    for k in range(len(theta)):
        def central(step):
            moved = [np.array(theta) for _ in range(2)]
            moved[0][k] += step
            moved[1][k] -= step
            ends = [np.array(list(figures(list(own)).values())) for own in moved]
            return (ends[0] - ends[1]) / (2 * step)
        step = 1e-3 * sd[k]
        columns.append((4 * central(step / 2) - central(step)) / 3)
    return np.array(columns).T


def differences(found):
    theta = [found["parameters"][name]["value"] for name in found["parameters"]]
    covariance = np.array(found["uncertainty"]["covariance"])
    expected = figures(theta)
    gradient = slopes(theta, np.sqrt(np.diag(covariance)))
    sd = np.sqrt(np.einsum("ij,jk,ik->i", gradient, covariance, gradient))
    worst = {"value": 0.0, "sd": 0.0}
    for (name, value), own in zip(expected.items(), sd):
        told = found["derived"][name]
        worst["value"] = max(worst["value"], abs(told["value"] / value - 1))
        worst["sd"] = max(worst["sd"], abs(told["sd"] / own - 1))
    # The slowest pole is one of eight, and the sum of the rotor speeds has one that no stick moves.
    poles = control.feedback(loop(theta), 1).poles()
    told = [complex(re, im) for re, im in found["closed_loop"]["poles"]]
    worst["poles"] = max(min(abs(pole - own) for own in told) / abs(pole) for pole in poles)
    return worst


def bode():
    theta = [short["parameters"][name]["value"] for name in short["parameters"]]
    response = linear["loops"][0]["response"]
    value = loop(theta)(1j * np.array(response["frequency"]))
    gain = np.abs(np.array(response["gain"]) / np.abs(value) - 1)
    phase = np.array(response["phase"]) - np.angle(value)
    return {"gain": gain.max(), "phase": np.abs(np.exp(1j * phase) - 1).max()}


print(json.dumps({"short": differences(short), "problem": differences(problem), "bode": bode()}))
