"""Data sets and starts of the race."""

import json
import math
import random
import subprocess
import tomllib

# Five people: gain [1/m], lead [s], delay [s], natural frequency of the arm [rad/s]. The first is the
# default of `pilotage trials synth`.
PILOTS = [
    {"gain": 0.03, "lead": 2.5, "delay": 0.15, "omega-n": 10},
    {"gain": 0.02, "lead": 3.0, "delay": 0.25, "omega-n": 8},
    {"gain": 0.04, "lead": 2.0, "delay": 0.10, "omega-n": 14},
    {"gain": 0.025, "lead": 2.2, "delay": 0.20, "omega-n": 6},
    {"gain": 0.035, "lead": 3.2, "delay": 0.18, "omega-n": 12},
]


def fly(pilotage, folder, number):
    """Lets the next pilot fly three times to 10 m and to 20 m; the manifest."""
    pilot = PILOTS[number % len(PILOTS)]
    output = folder / f"set{number + 1}"
    options = [f"--{name}={value}" for name, value in pilot.items()]
    command = [pilotage, "trials", "synth", "--force", "-o", output, f"--seed={number + 1}", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return output / "trials.toml"


def random_pilot(seed):
    """Any stable theta with a human's gain: poles, zeros and gain drawn widely, log-uniformly."""
    draw = random.Random(seed)
    spread = lambda low, high: math.exp(draw.uniform(math.log(low), math.log(high)))
    w, damping, pole = spread(0.2, 10), draw.uniform(0.2, 1.5), spread(0.2, 10)
    denominator = [w * w * pole, w * w + 2 * damping * w * pole, 2 * damping * w + pole]
    gain, lead, other = spread(0.005, 0.1), spread(0.3, 5), spread(0.05, 1)
    zeros = [1, lead + other, lead * other]
    return denominator + [-gain * denominator[0] * zero for zero in zeros]


def starts(ours, manifest, scheme, initial_state, count):
    """The default starts that pilotage estimates from the data, then random ones."""
    problem = {"manifest": str(manifest), "scheme": scheme, "initial_state": initial_state}
    named = [(f"default{i + 1}", theta) for i, theta in enumerate(ours.ask(problem)["candidates"])]
    rest = range(1, 1 + max(0, count - len(named)))
    named += [(f"random{i}", random_pilot(f"{manifest.parent.name} {i}")) for i in rest]
    return named[:count]


def read_theta(path):
    """theta of a pilot file (TOML), or of any JSON object with a list `theta`."""
    text = path.read_text()
    theta = json.loads(text)["theta"] if path.suffix == ".json" else tomllib.loads(text)["theta"]
    if isinstance(theta, dict):
        theta = [theta[f"theta{i + 1}"] for i in range(len(theta))]
    return theta
