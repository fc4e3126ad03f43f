"""The systems of examples/systems as one ODE each, by SciPy: rightmost pole and responses.

The vehicles are those of models_reference.py, pilots and controller are written by hand here: a delay of order n is
its Padé approximant in controllable form. Prints what is committed as tests/it/system_examples.txt.

    python3 tests/python/systems_reference.py > tests/it/system_examples.txt
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from models_reference import car, clip, dc_motor, hover, solve  # noqa: E402


def delayed2(x, u, tau):
    """(12 - 6 tau s + tau^2 s^2) / (12 + 6 tau s + tau^2 s^2)."""
    return u - 12 / tau * x[1], [x[1], u - 12 / tau**2 * x[0] - 6 / tau * x[1]]


def delayed3(x, u, tau):
    """(120 - 60 tau s + 12 tau^2 s^2 - tau^3 s^3) / (120 + 60 tau s + 12 tau^2 s^2 + tau^3 s^3)."""
    last = u - 120 / tau**3 * x[0] - 60 / tau**2 * x[1] - 12 / tau * x[2]
    return 240 / tau**3 * x[0] + 24 / tau * x[2] - u, [x[1], x[2], last]


def axis(x, error):
    """One axis of crossover2."""
    seen, rates = delayed2(x[:2], error, 0.25)
    rate = (0.05 * seen - x[2]) / 0.1
    return clip(x[2] + 2 * rate, -1, 1), [*rates, rate]


def flown(x, target, target2, wind, wind2):
    first, rates = axis(x[8:11], target - x[0])
    second, rates2 = axis(x[11:14], target2 - x[1])
    return [*hover(x[:8], first, second, wind, wind2), *rates, *rates2]


def driven(x, target):
    seen, rates = delayed3(x[5:8], target - x[0], 0.2)
    acceleration = 121 * (0.008 * seen - x[8]) - 7.7 * x[9]
    wheel = clip(x[8] + 3 * x[9], -1, 1)
    return [*car(x[:5], wheel), *rates, x[9], acceleration]


def held(x, target, load):
    error = target - x[1]
    wish = 0.2 * error + x[3]
    voltage = clip(wish, -24, 24)
    return [*dc_motor(x[:3], voltage, load), 0.2 * error / 0.05 + (voltage - wish) / 0.05]


# Right-hand side, start, inputs over time after so many jumps, when they jump, end, which state is which output.
SYSTEMS = {
    "hover": (
        flown,
        [0.0] * 14,
        lambda _, jumps: [(0, 0, 0, 0), (10, -5, 0, 0), (10, -5, 3, 2)][jumps],
        [1.0, 20.0],
        40.0,
        {"vehicle.position": 0, "vehicle.position2": 1, "vehicle.pitch": 4, "vehicle.roll": 6},
    ),
    "lane_change": (
        driven,
        [0.0] * 10,
        lambda t, _: (float(np.interp(t, [1, 6], [0, 3.5])),),
        [1.0, 6.0],
        20.0,
        {"car.position": 0, "car.heading": 1, "car.yaw_rate": 3},
    ),
    "motor": (
        held,
        [0.0, 0.0, 293.15, 0.0],
        lambda _, jumps: [(0, 0), (200, 0), (200, 0.1)][jumps],
        [0.1, 0.8],
        1.5,
        {"motor.speed": 1, "motor.current": 0, "motor.temperature": 2},
    ),
}


def jacobian(function, at):
    at, step = np.array(at), 1e-6
    column = lambda e: np.subtract(function(at + step * e), function(at - step * e)) / (2 * step)
    return np.array([column(e) for e in np.eye(len(at))]).T


def show(name, function, start, inputs, jumps, end, outputs):
    at_rest = np.zeros(len(inputs(0.0, 0)))
    matrix = jacobian(lambda x: function(x, *at_rest), start)
    print(f"rightmost {name} {max(np.linalg.eigvals(matrix).real):.8g}")
    state, begin = start, 0.0
    for count, stop in enumerate([*jumps, end]):
        right = lambda t, x: function(x, *inputs(t, count))
        times = [t for t in end * np.arange(1, 11) / 10 if begin < t <= stop]
        points = np.union1d(times, [stop])
        at, states = solve(right, (begin, stop), state, points, method="DOP853", rtol=1e-12, atol=1e-14)
        for t, x in zip(at, states):
            if t in times:
                row = (f"{signal}={x[k]:.12g}" for signal, k in outputs.items())
                print("response", name, f"{t:.12g}", *row)
        state, begin = states[-1], stop


def main():
    print("# Printed by tests/python/systems_reference.py: rightmost pole at rest [1/s], outputs at ten times.")
    for name, system in SYSTEMS.items():
        show(name, *system)


main()
