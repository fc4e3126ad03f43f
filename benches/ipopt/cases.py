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


def starts(ours, problem, count):
    """The first default starts of pilotage, then random ones."""
    named = [(f"default{i + 1}", theta) for i, theta in enumerate(ours.ask(problem)["candidates"])]
    rest = range(1, 1 + max(0, count - len(named)))
    named += [(f"random{i}", random_pilot(f"{problem['data_set']} {i}")) for i in rest]
    return named[:count]


def cases(ours, manifests, schemes, initial_state, count, thetas=None):
    """Every data set with every scheme from every start; `thetas` are starts of the user's."""
    for manifest in manifests:
        for scheme in schemes:
            problem = {
                "data_set": manifest.parent.name,
                "manifest": str(manifest),
                "scheme": scheme,
                "initial_state": initial_state,
            }
            for start, theta in thetas or starts(ours, problem, count):
                yield problem | {"start": start, "theta": theta}


def read_theta(path):
    """theta of a pilot file (TOML), or of any JSON object with a list `theta`."""
    text = path.read_text()
    theta = json.loads(text)["theta"] if path.suffix == ".json" else tomllib.loads(text)["theta"]
    if isinstance(theta, dict):
        theta = [theta[f"theta{i + 1}"] for i in range(len(theta))]
    if len(theta) != 6:
        raise SystemExit(f"{path}: theta has {len(theta)} numbers; the pilot here is of third order: 6")
    return theta
