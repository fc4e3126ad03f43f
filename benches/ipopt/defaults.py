"""How often `pilotage fit` as it comes, with the default starts, ends at the best objective known of a problem file:
from the model files' own values, and from others within a factor 3 of them."""

import json
import subprocess
import tempfile
import time

import humans
from loops import CASES

NEAR_THE_BEST = 1e-3  # relative


def fit(command, file):
    """Status, objective and seconds of a fit."""
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as out:
        done = subprocess.run([command, "fit", file, "--json", "-o", out], capture_output=True, text=True)
    if not done.stdout:
        raise SystemExit(done.stderr)
    found = json.loads(done.stdout)
    return found["status"], found["objective"], time.monotonic() - begin


def count(command, root, names, starts):
    """A line for each fit, and how many of each problem's are as good as the best; whether nine of ten are."""
    enough = True
    for case in (case for case in CASES if case.name in names):
        folder = root / "target" / "race" / "problems" / case.name
        ends = []
        for name, file in humans.write(case, folder, starts).items():
            default = folder / f"default-{name}.toml"
            default.write_text(file.read_text().replace("starts = 1\n", ""))
            status, objective, seconds = fit(command, default)
            ends.append((status == "converged", objective))
            print(f"{case.name:<10} {name:<8} {status:<16} {objective:>16.9f} {seconds:>7.2f} s", flush=True)
        converged = [objective for is_converged, objective in ends if is_converged]
        best = min(converged, default=float("nan"))
        good = sum(objective <= best * (1 + NEAR_THE_BEST) for objective in converged)
        print(f"{case.name:<10} {good} of {starts} within 0.1 % of {best:.9f}")
        enough = enough and 10 * good >= 9 * starts
    return enough
