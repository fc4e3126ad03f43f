"""Trials and manifests as docs/method.md describes them, in the units m and s."""

import csv
import math
import tomllib
from dataclasses import dataclass

import numpy as np


@dataclass
class Trial:
    """One run: times [s], target [m], position [m] (NaN where missing), weight of its squares."""

    name: str
    time: np.ndarray
    target: np.ndarray
    position: np.ndarray
    weight: float = 1.0


def read_trial(path, weight=1.0):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    header, *rows = csv.reader(lines)
    values = {}
    for i, cell in enumerate(header):
        name, _, unit = cell.strip().partition(" ")
        expected = {"time": "[s]", "target": "[m]", "position": "[m]"}.get(name)
        if expected is None:
            continue
        if unit not in ("", expected):
            raise SystemExit(f"{path}: {name} is in {unit}; only {expected} is read here")
        values[name] = np.array([float(row[i]) if row[i].strip() else math.nan for row in rows])
    missing = {"time", "target", "position"} - values.keys()
    if missing:
        raise SystemExit(f"{path}: no column {', '.join(sorted(missing))}")
    return Trial(path.stem, values["time"], values["target"], values["position"], weight)


def read_manifest(path):
    """The trials of a manifest that are meant for the fit."""
    runs = tomllib.loads(path.read_text())["run"]
    fit = [run for run in runs if run.get("use", "fit") == "fit"]
    return [read_trial(path.parent / run["file"], run.get("weight", 1.0)) for run in fit]
