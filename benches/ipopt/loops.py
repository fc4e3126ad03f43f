"""The closed loops of the race on problem files: equations by hand in CasADi, from what the model files cite."""

from dataclasses import dataclass, field
from math import factorial

import casadi as ca


@dataclass(frozen=True)
class Sought:
    """A sought parameter: the model file's value and its range."""

    start: float
    low: float = -ca.inf
    high: float = ca.inf

    def near(self, factor):
        return min(max(self.start * factor, self.low), self.high)


@dataclass(frozen=True)
class Case:
    """A problem: what flies what, and what is measured and sought."""

    name: str
    pilot: str
    vehicle: str
    equations: object  # (states, targets, parameters by name) -> derivatives and signals by name
    scheme: str
    humans: list  # for each axis gain, lead, delay, natural frequency of the arm
    size: float  # of the target's sines [m]
    runs: int
    samples: int
    measured: dict  # signal: column, standard deviation
    limited: list  # signals within -1 and 1
    sought: dict
    free: list = field(default_factory=list)  # states whose initial values are free
    missing: float = 0.0  # part of the cells


def pade(states, signal, delay):
    """e^(-s delay) = Q(-s)/Q(s) with Q(s) = sum c_k (delay s)^k: the states are w_k = c_k (delay s)^k/Q(s) of the
    signal, k from 0. What comes out, and the states' derivatives."""
    n = len(states)
    c = [
        factorial(2 * n - k) * factorial(n) / (factorial(2 * n) * factorial(k) * factorial(n - k))
        for k in range(n + 1)
    ]
    w = [*states, signal - sum(states)]
    rates = [c[k] / (c[k + 1] * delay) * w[k + 1] for k in range(n)]
    return sum((-1) ** k * w[k] for k in range(n + 1)), rates


def delayed(x, wish, order, gain, error, delay):
    """The gain times the delayed error, and the derivatives of the delay's states by name."""
    names = [f"pilot.{wish}_delay_{k + 1}" for k in range(order)]
    value, rates = pade([x[name] for name in names], error, delay)
    return gain * value, dict(zip(names, rates))


def precision_loop(x, target, p):
    """McRuer's precision model with K/s^2."""
    wish, rates = delayed(x, "wish", 3, p["pilot.gain"], target[0] - x["vehicle.position"], p["pilot.delay"])
    lagged, muscle, arm, arm_rate = (x[f"pilot.{n}"] for n in ("lagged", "muscle", "arm", "arm_rate"))
    lagged_rate = (wish - lagged) / p["pilot.lag"]
    omega, zeta = p["pilot.omega_n"], p["pilot.zeta_n"]
    rates |= {
        "pilot.lagged": lagged_rate,
        "pilot.muscle": (lagged + p["pilot.lead"] * lagged_rate - muscle) / p["pilot.muscle_lag"],
        "pilot.arm": arm_rate,
        "pilot.arm_rate": omega**2 * (muscle - arm) - 2 * zeta * omega * arm_rate,
        "vehicle.position": x["vehicle.speed"],
        "vehicle.speed": 5 * arm,
    }
    return rates, {"vehicle.position": x["vehicle.position"], "pilot.stick": arm}


def hover_loop(x, target, p):
    """The crossover pilot in two axes, with the tilt of a rotorcraft near hover."""
    rates, signals = {}, {}
    omega, zeta, reach, gravity, drag = 5, 0.8, 0.5, 9.80665, 0.3
    pull = [ca.tan(x["vehicle.pitch"]), ca.tan(x["vehicle.roll"]) / ca.cos(x["vehicle.pitch"])]
    for k, (s, tilt) in enumerate([("", "pitch"), ("2", "roll")]):
        position, velocity = x[f"vehicle.position{s}"], x[f"vehicle.velocity{s}"]
        wish, own = delayed(x, f"wish{s}", 2, p[f"pilot.gain{s}"], target[k] - position, p["pilot.delay"])
        lagged_rate = (wish - x[f"pilot.lagged{s}"]) / p["pilot.lag"]
        stick = x[f"pilot.lagged{s}"] + p["pilot.lead"] * lagged_rate
        angle, turn = x[f"vehicle.{tilt}"], x[f"vehicle.{tilt}_rate"]
        rates |= own | {
            f"pilot.lagged{s}": lagged_rate,
            f"vehicle.position{s}": velocity,
            f"vehicle.velocity{s}": gravity * pull[k] - drag * velocity,
            f"vehicle.{tilt}": turn,
            f"vehicle.{tilt}_rate": omega**2 * (reach * stick - angle) - 2 * zeta * omega * turn,
        }
        signals |= {f"vehicle.position{s}": position, f"pilot.stick{s}": stick}
    return rates, signals


def tracking_loop(x, target, p):
    """The crossover pilot with K/s."""
    position, arm = x["vehicle.position"], x["pilot.arm"]
    wish, rates = delayed(x, "wish", 2, p["pilot.gain"], target[0] - position, p["pilot.delay"])
    rates |= {"pilot.arm": (wish - arm) / p["pilot.lag"], "vehicle.position": p["vehicle.gain"] * arm}
    return rates, {"vehicle.position": position, "pilot.stick": arm}


def linear_loop(x, target, p):
    """The linear pilot of order 3 in observable canonical form with K/s."""
    position, stick = x["vehicle.position"], x["pilot.x1"]
    error = target[0] - position
    rates = {
        "pilot.x1": x["pilot.x2"] + p["pilot.theta6"] * error - p["pilot.theta3"] * stick,
        "pilot.x2": x["pilot.x3"] + p["pilot.theta5"] * error - p["pilot.theta2"] * stick,
        "pilot.x3": p["pilot.theta4"] * error - p["pilot.theta1"] * stick,
        "vehicle.position": 10.0 * stick,
    }
    return rates, {"vehicle.position": position, "pilot.stick": stick}


def person(name, *measured):
    """Ten runs of a person, as recorded in a laboratory, and a linear pilot: what is measured of stick and position."""
    signals = {"vehicle.position": ("position", 0.2), "pilot.stick": ("stick", 0.03)}
    theta = [216, 108, 18, 21.6, 0, 0]
    return Case(
        name, "linear", "integrator", linear_loop, "trapezoid",
        humans=[(0.2, 0.0, 0.23, 12)], size=1.0, runs=10, samples=1351,
        measured={signal: signals[signal] for signal in measured},
        limited=[],  # its corner is rounded, and nobody reaches it
        sought={f"pilot.theta{k + 1}": Sought(value) for k, value in enumerate(theta)},
        free=["pilot.x1", "pilot.x2", "pilot.x3", "vehicle.position"],
    )  # fmt: skip


CASES = [
    Case(
        "precision", "precision", "double_integrator", precision_loop, "hermite-simpson",
        humans=[(0.05, 3.0, 0.17, 12)], size=1.0, runs=3, samples=1201,
        measured={"vehicle.position": ("position", 0.2), "pilot.stick": ("stick", 0.03)},
        limited=["pilot.stick"],
        sought={
            "pilot.gain": Sought(0.03),
            "pilot.lead": Sought(2.5, 0, 50),
            "pilot.lag": Sought(0.1, 0.005, 50),
            "pilot.delay": Sought(0.1, 0.01, 3),
            "pilot.muscle_lag": Sought(0.1, 0.005, 5),
            "pilot.omega_n": Sought(20, 1, 100),
            "pilot.zeta_n": Sought(0.7, 0.01, 5),
        },
    ),
    Case(
        "hover", "crossover2", "hover", hover_loop, "hermite-simpson",
        humans=[(0.05, 2.5, 0.2, 12), (0.07, 2.2, 0.2, 12)], size=1.0, runs=3, samples=601,
        measured={
            "vehicle.position": ("position", 0.2),
            "vehicle.position2": ("position2", 0.2),
        },
        limited=["pilot.stick", "pilot.stick2"],
        sought={
            "pilot.gain": Sought(0.05),
            "pilot.gain2": Sought(0.05),
            "pilot.lead": Sought(2, 0, 50),
            "pilot.lag": Sought(0.1, 0.005, 50),
            "pilot.delay": Sought(0.25, 0.01, 3),
        },
    ),
    Case(
        "tracking", "crossover", "integrator", tracking_loop, "trapezoid",
        humans=[(0.2, 0.0, 0.23, 12)], size=1.0, runs=10, samples=1351,
        measured={"vehicle.position": ("position", 0.2), "pilot.stick": ("stick", 0.03)},
        limited=["pilot.stick"],
        sought={
            "pilot.gain": Sought(0.1),
            "pilot.lag": Sought(0.1, 0.005, 5),
            "pilot.delay": Sought(0.3, 0.01, 3),
            "vehicle.gain": Sought(10),
        },
        free=["vehicle.position"],
        missing=0.03,
    ),
    person("person", "vehicle.position", "pilot.stick"),
    person("person-stick", "pilot.stick"),
    person("person-position", "vehicle.position"),
]  # fmt: skip
