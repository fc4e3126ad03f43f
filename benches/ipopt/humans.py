"""Recordings of synthetic humans, and the problem files beside them, in target/race/problems.

They are not the pilots that are fitted, as in crates/flights/src/synthetic: gain and lead on the error seen an
exact delay ago, through the second-order lag of the arm, with coloured noise (remnant), and the stick ends at its
stops.
"""

import math
import random
from collections import deque

STEP = 2.5e-3  # of the integration [s]
RATE = 20  # samples a second


class Target:
    """A sum of sines, none of them a multiple of another, the faster the smaller."""

    OMEGA = [0.17, 0.31, 0.53, 0.87, 1.37, 2.11, 3.49]  # [rad/s]

    def __init__(self, size, draw):
        self.waves = [(size / (1 + w), w, draw.uniform(0, 2 * math.pi)) for w in self.OMEGA]

    def value(self, t):
        return sum(a * (math.sin(w * t + phase) - math.sin(phase)) for a, w, phase in self.waves)

    def rate(self, t):
        return sum(a * w * math.cos(w * t + phase) for a, w, phase in self.waves)


class Human:
    """One axis of a human: gain [1/m], lead [s], delay [s], natural frequency [rad/s] of the arm."""

    DAMPING, REMNANT, REMNANT_TIME = 0.6, 0.02, 0.4

    def __init__(self, draw, gain, lead, delay, omega):
        self.draw, self.gain, self.lead, self.omega = draw, gain, lead, omega
        self.seen = deque([0.0] * round(delay / STEP))
        self.noise = self.arm = self.rate = 0.0

    def stick(self, error, error_rate):
        self.seen.append(self.gain * (error + self.lead * error_rate))
        share = STEP / self.REMNANT_TIME
        self.noise += self.REMNANT * math.sqrt(2 * share) * self.draw.gauss(0, 1) - share * self.noise
        wish = self.seen.popleft() + self.noise
        self.rate += STEP * (self.omega**2 * (wish - self.arm) - 2 * self.DAMPING * self.omega * self.rate)
        self.arm += STEP * self.rate
        return min(max(self.arm, -1.0), 1.0)


class DoubleIntegrator:
    """K/s^2 in so many axes."""

    GAIN = 5.0

    def __init__(self, axes):
        self.position, self.speed = [0.0] * axes, [0.0] * axes

    def step(self, sticks):
        for k, stick in enumerate(sticks):
            self.position[k] += STEP * self.speed[k]
            self.speed[k] += STEP * self.GAIN * stick


class Integrator(DoubleIntegrator):
    """K/s."""

    GAIN = 10.0

    def step(self, sticks):
        for k, stick in enumerate(sticks):
            self.speed[k] = self.GAIN * stick
            self.position[k] += STEP * self.speed[k]


class Hover(DoubleIntegrator):
    """Tilt on command accelerates, drag brakes, as in the model file `hover`."""

    def __init__(self, axes):
        super().__init__(axes)
        self.tilt, self.tilt_rate = [0.0] * axes, [0.0] * axes

    def step(self, sticks):
        pull = [math.tan(tilt) for tilt in self.tilt]
        pull[1] /= math.cos(self.tilt[0])
        for k, stick in enumerate(sticks):
            self.position[k] += STEP * self.speed[k]
            self.speed[k] += STEP * (9.80665 * pull[k] - 0.3 * self.speed[k])
            self.tilt[k] += STEP * self.tilt_rate[k]
            self.tilt_rate[k] += STEP * (25 * (0.5 * stick - self.tilt[k]) - 8 * self.tilt_rate[k])


VEHICLES = {"double_integrator": DoubleIntegrator, "integrator": Integrator, "hover": Hover}
SUFFIXES = ["", "2"]  # of the signals of each axis


def fly(case, draw):
    """A run: rows of time, and for each axis target, position and stick."""
    axes = len(case.humans)
    vehicle = VEHICLES[case.vehicle](axes)
    humans = [Human(draw, *human) for human in case.humans]
    targets = [Target(case.size, draw) for _ in humans]
    every = round(1 / (RATE * STEP))
    sticks = [0.0] * axes
    for k in range((case.samples - 1) * every + 1):
        t = k * STEP
        aims = [target.value(t) for target in targets]
        if k % every == 0:
            rows = zip(aims, vehicle.position, sticks)
            yield [k / every / RATE] + [value for row in rows for value in row]
        errors = [aim - z for aim, z in zip(aims, vehicle.position)]
        rates = [target.rate(t) - v for target, v in zip(targets, vehicle.speed)]
        sticks = [human.stick(*seen) for human, *seen in zip(humans, errors, rates)]
        vehicle.step(sticks)


NOISE = {"position": 0.02, "stick": 0.01}  # of the sensors


def cells(case, row, draw):
    """A row as text, with the noise of the sensors; what they missed is empty."""
    yield f"{row[0]:.4f}"
    for k, value in enumerate(row[1:]):
        name = ("target", "position", "stick")[k % 3]
        noisy = value + draw.gauss(0, NOISE.get(name, 0.0))
        is_missing = draw.random() < case.missing and name != "target"
        yield "" if is_missing else f"{noisy:.6f}"


def record(case, folder):
    """Writes the runs of a case; their names."""
    folder.mkdir(parents=True, exist_ok=True)
    units = {"target": "m", "position": "m", "stick": "1"}
    suffixes = SUFFIXES[: len(case.humans)]
    header = ["time [s]"] + [f"{name}{s} [{units[name]}]" for s in suffixes for name in units]
    names = [f"run{number + 1}.csv" for number in range(case.runs)]
    for number, name in enumerate(names):
        draw = random.Random(f"{case.name} {number}")
        rows = [",".join(cells(case, row, draw)) for row in fly(case, draw)]
        (folder / name).write_text("\n".join([",".join(header), *rows]) + "\n")
    return names


def starts(case, count):
    """The model files' own values, and others within a factor 3 of them."""
    draw = random.Random(case.name)
    named = {"own": {name: about.start for name, about in case.sought.items()}}
    for number in range(1, count):
        near = {n: about.near(3 ** draw.uniform(-1, 1)) for n, about in case.sought.items()}
        named[f"drawn{number}"] = near
    return named


def problem_file(case, runs, start):
    """The text of a problem file."""
    suffixes = SUFFIXES[: len(case.humans)]
    wires = [f'"pilot.stick{s}" = "vehicle.stick{s}"' for s in suffixes]
    wires += [f'"vehicle.position{s}" = "pilot.position{s}"' for s in suffixes]
    lines = ["[system.pilot]", f'model = "{case.pilot}"']
    lines += ["[system.vehicle]", f'model = "{case.vehicle}"', "[connect]", *wires]
    lines += ["[inputs]"] + [f'"pilot.target{s}" = "target{s}"' for s in suffixes]
    for signal, (column, sd) in case.measured.items():
        lines += ["[[measured]]", f'signal = "{signal}"', f'column = "{column}"', f"sd = {sd}"]
    lines += ["[parameters]"] + [f'"{n}" = {{ start = {x!r} }}' for n, x in start.items()]
    lines += ["[initial]"] + [f'"{state}" = "free"' for state in case.free]
    for run in runs:
        lines += ["[[run]]", f'file = "{run}"']
    lines += ["[fit]", f'scheme = "{case.scheme}"', 'mesh = "samples"', "starts = 1", "tolerance = 1e-8"]
    return "\n".join(lines) + "\n"


def write(case, folder, count):
    """Recordings and a problem file for each start; the files by the names of the starts."""
    runs = record(case, folder)
    files = {}
    for name, start in starts(case, count).items():
        files[name] = folder / f"{name}.toml"
        files[name].write_text(problem_file(case, runs, start))
    return files
