"""Flights of the synthetic human, fits of them, and the loops that human and pilots close."""

import cmath
import json
import math
import os
import statistics
import subprocess
from functools import cache
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
HUMAN = {"gain": 0.03, "lead": 2.5, "delay": 0.15, "omega_nm": 10.0, "zeta_nm": 0.7}  # of `trials synth`
ARM = {"omega_nm": 10.0, "zeta_nm": 0.7}

PROBLEM = """
[system.pilot]
model = "{pilot}"
{system}
[[measured]]
signal = "{signal}"
column = "{column}"
sd = {sd}
[parameters]
{parameters}
[fit]
{mesh}
starts = 1
{runs}
"""
# The model's loop: the target alone drives it.
CLOSED = """
[system.vehicle]
model = "{vehicle}"
[connect]
"pilot.stick" = "vehicle.stick"
"vehicle.{output}" = "pilot.position"
{wires}
[inputs]
"pilot.target" = {{ column = "target", hold = "{hold}" }}
"""
# The pilot by itself, driven by what was recorded.
OPEN = """
[inputs]
"pilot.target" = {{ column = "target", hold = "{hold}" }}
"pilot.position" = {{ column = "position", hold = "linear" }}
"""


@cache
def binary():
    """The command: $PILOTAGE, the newest that cargo built, or one built now."""
    if given := os.environ.get("PILOTAGE"):
        return given
    built = sorted(ROOT.glob("target/*/pilotage"), key=lambda file: file.stat().st_mtime)
    if not built:
        subprocess.run(["cargo", "build", "--release", "--bin", "pilotage"], cwd=ROOT, check=True)
        built = [ROOT / "target/release/pilotage"]
    return str(built[-1])


def pilotage(*arguments):
    """What the command prints, on one thread. Exit code 1 is an answer, too: not converged."""
    command = [binary(), *map(str, arguments)]
    environment = os.environ | {"RAYON_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(command)}\n{done.stderr}")
    return done.stdout


def fly(folder, **options):
    """The runs of the synthetic human with these options of `trials synth`."""
    flags = [part for name, value in options.items() for part in (f"--{name.replace('_', '-')}", value)]
    pilotage("trials", "synth", "-o", folder, "--force", *flags)
    return sorted(folder.glob("*run*.csv"))


def problem(runs, pilot="extended_crossover", vehicle="quadcopter", method="response", free=None, fixed=ARM, sd=0.1,
            mesh='mesh = "samples"', hold="linear"):
    """A problem file: pilot, vehicle, what is compared, `free` (starts of the parameters sought) and what is `fixed`."""
    sign = -1 if vehicle == "quadcopter" else 1
    free = free or {"gain": 0.03, "lead": 2.5, "delay": 0.2}
    wires = '"vehicle.v" = "pilot.speed"' if Path(pilot).stem == "pursuit" else ""
    output = "z" if vehicle == "quadcopter" else "position"
    closed = CLOSED.format(vehicle=vehicle, output=output, wires=wires, hold=hold)
    lines = [f'"pilot.{name}" = {{ start = {value} }}' for name, value in free.items() if name != "gain"]
    lines.append(f'"pilot.gain" = {{ start = {sign * free["gain"]}, min = {min(sign, 0)}, max = {max(sign, 0)} }}')
    lines += [f'"pilot.{name}" = {{ start = {value}, fixed = true }}' for name, value in fixed.items()]
    signal, column = ("pilot.stick", "stick") if method != "response" else (f"vehicle.{output}", "position")
    return PROBLEM.format(pilot=pilot, system=OPEN.format(hold=hold) if method == "stick" else closed, signal=signal,
                          column=column, sd=sd, parameters="\n".join(lines), mesh=mesh,
                          runs="\n".join(f'[[run]]\nfile = "{run}"' for run in runs))


def fit(runs, **options):
    """The parameters found, and `bounds`, those on an end of their range."""
    file = runs[0].parent / "problem.toml"
    file.write_text(problem(runs, **options))
    found = json.loads(pilotage("fit", file, "--json", "--force", "-o", file.with_name("fitted.toml")))
    parameters = found["parameters"]
    values = {name.split(".")[1]: abs(entry["value"]) for name, entry in parameters.items()}
    values["bounds"] = [name.split(".")[1] for name, entry in parameters.items() if "bound" in entry]
    values["status"] = found["status"]
    values["doubts"] = codes(found)
    residuals = [measured["rms_residual"] for run in found["runs"] for measured in run["measured"].values()]
    values["rms"] = math.sqrt(statistics.fmean(r * r for r in residuals))
    return values


def codes(found):
    """The codes of the diagnostics."""
    return sorted({doubt["code"] for doubt in found["doubts"]})


def fit_linear(runs, objective="response"):
    """The paper's pilot of third order, of each objective: crossover, margin, whether its loop is stable, and the rms
    [m] between its flights alone and the recorded ones where both are fitted."""
    vehicle = ROOT / "examples/vehicles/quadcopter.toml"
    output = json.loads(pilotage("fit", *runs, "--vehicle", vehicle, "--objective", objective, "--json", "--force", "-o",
                                 runs[0].with_name("pilot.toml")))
    fits = {name: output[name] for name in ("response", "stick")} if objective == "both" else {objective: output}
    found = {}
    for name, fit in fits.items():
        theta = [fit["parameters"][f"pilot.theta{k}"]["value"] for k in range(1, 7)]
        pilot = lambda s: -(theta[5] * s**2 + theta[4] * s + theta[3]) / (s**3 + theta[2] * s**2 + theta[1] * s + theta[0])
        width, margin = crossover(pilot)
        found[name] = {"crossover": width, "margin": margin, "stable": "unstable-loop" not in codes(fit),
                       "status": fit["status"], "doubts": codes(fit)}
        if objective == "both":
            found[name]["alone"] = statistics.fmean(run[f"{name}_rms_m"] for run in output["flown_alone"])
    return found


def quadcopter(s):
    """Position over stick forward, about hover (docs/method.md), with the default coefficients."""
    slope = math.sqrt(2) * 0.225 / 0.0123 * 1.2 * 9.80665 / 0.9214 * 0.0222
    attitude = slope * 22.96
    return 9.80665 * math.pi / 4 * attitude / (s**2 * (s**3 + 14.48 * s**2 + slope * 10.76 * s + attitude))


def integrator(s):
    return 10 / s


def double_integrator(s):
    return 5 / s**2


def pade(order, x):
    """Pade's approximation of exp(-x), numerator and denominator of that order."""
    factor = math.factorial
    weights = [factor(2 * order - k) / (factor(k) * factor(order - k)) for k in range(order + 1)]
    polynomial = lambda y: sum(weight * y**k for k, weight in enumerate(weights))
    return polynomial(-x) / polynomial(x)


def human(p):
    """Stick over error; with a pure delay, or one of that Pade `order`."""
    late = (lambda x: pade(p["order"], x)) if "order" in p else (lambda x: cmath.exp(-x))
    arm = lambda s: (s / p["omega_nm"]) ** 2 + 2 * p["zeta_nm"] * s / p["omega_nm"] + 1
    return lambda s: p["gain"] * (1 + p["lead"] * s) * late(p["delay"] * s) / arm(s)


def crossover(pilot, vehicle=quadcopter):
    """Lowest frequency [rad/s] where the open loop's magnitude falls through 1, and the phase margin [deg]."""
    size = lambda w: abs(pilot(1j * w) * vehicle(1j * w))
    grid = [0.02 * 1.02**k for k in range(400)]
    pairs = [(a, b) for a, b in zip(grid, grid[1:]) if size(a) >= 1 > size(b)]
    if not pairs:
        return math.nan, math.nan
    low, high = pairs[0]
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if size(middle) >= 1 else (low, middle)
    loop = -pilot(1j * low) * vehicle(1j * low)
    return low, math.degrees(cmath.phase(loop))
