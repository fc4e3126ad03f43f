"""The models of examples/models, simulated by SciPy from right-hand sides written by hand.

Prints what is committed as tests/it/model_examples.txt: for each model the inputs, which are constant from one time
to the next, and its states at ten times. No model file is read; of the tables, the CSV files are.

    python3 tests/python/models_reference.py > tests/it/model_examples.txt
"""

from pathlib import Path

import numpy as np
from numpy import cos, sin, sqrt, tan, tanh
from scipy.integrate import solve_ivp

MODELS = Path(__file__).parents[2] / "examples/models"


class Corners:
    """`interp(value, x, y)`, whose segments can be held: then each goes on beyond its ends, so that no step of an
    integrator has a corner within, and what it gives does not hang on last digits, which differ between machines."""

    def __init__(self):
        self.segments, self.seen = None, []

    def interp(self, value, x, y):
        k = int(np.searchsorted(x, value)) if self.segments is None else self.segments[len(self.seen)]
        self.seen.append((value, x, k))
        if k in (0, len(x)):
            return y[max(k - 1, 0)]
        return y[k - 1] + (value - x[k - 1]) * (y[k] - y[k - 1]) / (x[k] - x[k - 1])

    def held(self, right):
        """The right-hand side, whose values are counted from its begin."""

        def at(t, x):
            self.seen = []
            return right(t, x)

        return at

    def look(self, right, t, x):
        """Value, corners and segment of all that has corners, in the order of the calls."""
        self.held(right)(t, x)
        return self.seen

    def event(self, right, which, end):
        """Where a value leaves its segment downwards (end 0) or upwards (end 1); one that rests on a corner does not."""
        step = 2 * end - 1

        def distance(t, x):
            value, corners, k = self.look(right, t, x)[which]
            return value - corners[k - 1 + end] - step * 1e-12

        distance.terminal, distance.direction, distance.to = True, step, (which, step)
        return distance


CORNERS = Corners()


def curve(name):
    x, y = np.loadtxt(MODELS / name, delimiter=",", skiprows=1).T
    return lambda at: CORNERS.interp(at, x, y)


def clip(value, low, high):
    return CORNERS.interp(value, (low, high), (low, high))


def solve(right, span, state, points, **settings):
    """`solve_ivp` from one corner to the next: times and states at the points."""
    begin, stop = span
    times, states = [], []
    CORNERS.segments = None
    CORNERS.segments = [k for _, _, k in CORNERS.look(right, begin, state)]
    while True:
        seen = CORNERS.look(right, begin, state)
        ends = [(which, end) for which, (_, x, k) in enumerate(seen) for end in (0, 1) if 0 <= k - 1 + end < len(x)]
        events = [CORNERS.event(right, which, end) for which, end in ends]
        wanted = [t for t in points if t > begin]
        run = solve_ivp(CORNERS.held(right), (begin, stop), state, t_eval=wanted, events=events or None, **settings)
        assert run.success, run.message
        times, states = [*times, *run.t], [*states, *np.array(run.y).T]
        if run.status == 0:
            CORNERS.segments = None
            return np.array(times), np.array(states)
        k = next(k for k, found in enumerate(run.t_events) if len(found))
        begin, state = run.t_events[k][0], run.y_events[k][0]
        which, step = events[k].to
        CORNERS.segments[which] += step


def hover(x, stick, stick2, wind, wind2):
    """Newton's law along and across, the tilted thrust of constant vertical part, drag along the airspeed."""
    _, _, vx, vy, pitch, pitch_rate, roll, roll_rate = x
    m, g = 1.5, 9.80665
    ux, uy = vx - wind, vy - wind2
    speed = sqrt(ux * ux + uy * uy + 0.01**2)
    along = 0.35 * ux + 0.5 * 1.225 * 0.03 * speed * ux
    across = 0.35 * uy + 0.5 * 1.225 * 0.03 * speed * uy
    want_pitch, want_roll = (clip(0.7 * u, -0.5, 0.5) for u in (stick, stick2))
    return [
        vx,
        vy,
        g * sin(pitch) / cos(pitch) - along / m,
        g * sin(roll) / (cos(roll) * cos(pitch)) - across / m,
        pitch_rate,
        36.0 * (want_pitch - pitch) - 9.0 * pitch_rate,
        roll_rate,
        16.0 * (want_roll - roll) - 6.0 * roll_rate,
    ]


def short_period_actuator(x, stick, gust):
    """Forces normal to the path, moments in pitch; u0 = 871 ft/s."""
    alpha, q, theta, _, elevator = x
    u0 = 871 * 0.3048
    air = alpha + gust / u0
    lift = -0.389212 * u0 * air - 0.021057 * u0 * elevator
    alpha_rate = q + lift / u0
    moment = -1.6165 * air - 0.1425 * alpha_rate - 0.4038 * q - 1.2124 * elevator
    command = clip(-0.2 * stick, -0.15, 0.1)
    rate = clip((command - elevator) / 0.05, -0.3, 0.3)
    return [alpha_rate, moment, q, u0 * (theta - alpha), rate]


TYRE = curve("tyre.csv")


def car(x, wheel):
    """Forces across and moments about the vertical axis of a single-track car."""
    _, heading, v, r, steer = x
    m, inertia, a, b, u, g = 1500.0, 2500.0, 1.2, 1.5, 25.0, 9.80665
    front_load, rear_load = m * g * b / (a + b), m * g * a / (a + b)
    front = 0.9 * 0.9 * front_load * TYRE(steer - np.arctan2(v + a * r, u)) * cos(steer)
    rear = 0.9 * rear_load * TYRE(-np.arctan2(v - b * r, u))
    return [
        u * sin(heading) + v * cos(heading),
        r,
        (front + rear) / m - u * r,
        (a * front - b * rear) / inertia,
        (0.2 * wheel - steer) / 0.1,
    ]


def dc_motor(x, voltage, load):
    """Kirchhoff's law of the winding, Newton's of the rotor, the first law of the copper."""
    i, w, t = x
    r = 0.8 * (1 + 0.0039 * (t - 293.15))
    torque = 0.06 * i - 2e-5 * w - 0.008 * tanh(w / 0.5) - load
    return [
        (voltage - r * i - 0.06 * w) / 1e-3,
        torque / 8e-5,
        (r * i * i - (t - 293.15) / 4.0) / 60.0,
    ]


FILM = curve("film.csv")


def heat_exchanger(x, hot_in, cold_in, hot_flow, cold_flow):
    """Balance of enthalpy of each cell."""
    hot, cold = np.array(x[:3]), np.array(x[3:])
    cp = 4180.0
    ua = 1 / (1 / FILM(hot_flow) + 1 / FILM(cold_flow))
    heat = ua / 3 * (hot - cold)
    before_hot = np.array([hot_in, hot[0], hot[1]])
    before_cold = np.array([cold[1], cold[2], cold_in])
    return [
        *((hot_flow * cp * (before_hot - hot) - heat) / (4.0 / 3 * cp)),
        *((cold_flow * cp * (before_cold - cold) + heat) / (5.0 / 3 * cp)),
    ]


# Function, names and start of the states, times at which inputs change with their values, end.
CASES = {
    "hover": (
        hover,
        "position position2 velocity velocity2 pitch pitch_rate roll roll_rate",
        [0.0] * 8,
        [
            (0.0, dict(stick=0.3, stick2=-0.2, wind=3.0, wind2=-1.0)),
            (2.0, dict(stick=1.0, stick2=0.1, wind=-4.0, wind2=2.0)),
            (4.5, dict(stick=-0.4, stick2=-0.9, wind=0.0, wind2=0.0)),
        ],
        8.0,
    ),
    "short_period_actuator": (
        short_period_actuator,
        "alpha q theta height elevator",
        [0.0] * 5,
        [
            (0.0, dict(stick=0.1, gust=0.0)),
            (2.0, dict(stick=1.0, gust=5.0)),
            (5.0, dict(stick=-0.8, gust=-3.0)),
        ],
        10.0,
    ),
    "car": (
        car,
        "position heading side yaw_rate steer",
        [0.0] * 5,
        [(0.0, dict(wheel=0.1)), (1.5, dict(wheel=-0.9)), (3.0, dict(wheel=0.2))],
        5.0,
    ),
    "dc_motor": (
        dc_motor,
        "current speed temperature",
        [0.0, 0.0, 293.15],
        [
            (0.0, dict(voltage=12.0, load=0.0)),
            (0.2, dict(voltage=24.0, load=0.2)),
            (0.5, dict(voltage=-6.0, load=0.05)),
        ],
        1.0,
    ),
    "heat_exchanger": (
        heat_exchanger,
        "hot1 hot2 hot3 cold1 cold2 cold3",
        [290.0] * 6,
        [
            (0.0, dict(hot_in=350.0, cold_in=290.0, hot_flow=0.5, cold_flow=0.8)),
            (30.0, dict(hot_in=355.0, cold_in=285.0, hot_flow=0.15, cold_flow=0.8)),
            (70.0, dict(hot_in=340.0, cold_in=285.0, hot_flow=1.1, cold_flow=0.25)),
        ],
        120.0,
    ),
}


def simulate(function, start, inputs, end, **options):
    """The states at ten times, from one change of the inputs to the next."""
    settings = dict(method="DOP853", rtol=1e-12, atol=1e-14, dense_output=False) | options
    times = end * np.arange(1, 11) / 10
    found, state = [], np.array(start)
    ends = [time for time, _ in inputs[1:]] + [end]
    for (begin, values), stop in zip(inputs, ends):
        wanted = times[(times > begin) & (times <= stop)]
        points = np.union1d(wanted, [stop])
        right = lambda _, x: function(x, **values)
        at, states = solve(right, (begin, stop), state, points, **settings)
        found += [x for t, x in zip(at, states) if t in wanted]
        state = states[-1]
    return times, np.array(found)


def main():
    print("# Printed by tests/python/models_reference.py: inputs from a time on, and states at ten times.")
    for model, (function, names, start, inputs, end) in CASES.items():
        for time, values in inputs:
            print("input", model, time, *(f"{name}={value}" for name, value in values.items()))
        for time, state in zip(*simulate(function, start, inputs, end)):
            row = (f"{name}={value:.15g}" for name, value in zip(names.split(), state))
            print("state", model, f"{time:.15g}", *row)


if __name__ == "__main__":
    main()
