"""Solves pilotage's identification problem with CasADi and IPOPT, from pilotage's solution.

The NLP is written here a second time, from docs/method.md and the published schemes; nothing but the
start is taken from pilotage. Run from the repository's root:

    cargo bench --bench solve -- --solution tests/casadi/solution.json
    python3 tests/casadi/compare.py

It makes a virtual environment in .venv/casadi with requirements.txt, solves the problem with each
scheme from two starts, the solution as it is and one with every parameter 2 % off, and writes
tests/casadi/result.json.
"""

import csv
import json
import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent

# Lobatto IIIA (Hairer & Wanner II, table 5.7) and forward Euler: abscissae, weights of unknown nodes.
SCHEMES = {
    "euler": ([0, 1], [[1, 0]]),
    "trapezoid": ([0, 1], [[1 / 2, 1 / 2]]),
    "hermite-simpson": ([0, 1 / 2, 1], [[5 / 24, 1 / 3, -1 / 24], [1 / 6, 2 / 3, 1 / 6]]),
}
MARGIN = 1e-6  # of the stability conditions
OFFSET = [1.02, 0.98, 1.02, 0.98, 1.02, 0.98]
IPOPT = {
    "tol": 1e-9,
    "constr_viol_tol": 1e-10,
    "mu_init": 1e-5,
    "bound_relax_factor": 0.0,
    "max_iter": 1000,
    "print_level": 0,
    "sb": "yes",
}


def own_environment():
    """Continues inside the virtual environment with the pinned packages."""
    home = ROOT / ".venv" / "casadi"
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if Path(sys.prefix).resolve() == home.resolve():
        return
    if not python.exists():
        venv.create(home, with_pip=True)
        requirements = HERE / "requirements.txt"
        subprocess.run([python, "-m", "pip", "install", "-q", "-r", requirements], check=True)
    sys.exit(subprocess.run([python, __file__, *sys.argv[1:]]).returncode)


def read_trial(path):
    rows = [row for row in csv.reader(path.read_text().splitlines()) if not row[0].startswith("#")]
    columns = [name.split(" ")[0] for name in rows[0]]
    return {name: [float(row[i]) for row in rows[1:]] for i, name in enumerate(columns)}


def joint(ca):
    """Closed loop of the quadcopter's pitch axis and a third-order pilot: x' = f(x, target, theta)."""
    x, target, theta = ca.SX.sym("x", 9), ca.SX.sym("target"), ca.SX.sym("theta", 6)
    z, phi, v, q, front, back = ca.vertsplit(x[:6])
    pilot = x[6:]
    mass, arm, inertia, gravity, hover = 1.2, 0.225, 0.0123, 9.80665, 0.9214
    lag, gain, k_phi, k_q, full = 14.48, 0.0222, 22.96, 10.76, ca.pi / 4
    stick = ca.dot(theta[3:], pilot)
    thrust = lambda omega: mass * gravity / 4 * (1 + omega / hover) ** 2
    throttle = k_phi * (full * stick - phi) - k_q * q
    rate = ca.vertcat(
        v,
        q,
        -2 / mass * (thrust(front) + thrust(back)) * ca.sin(phi),
        ca.sqrt(2) * arm / inertia * (thrust(front) - thrust(back)),
        -lag * front + gain * throttle,
        -lag * back - gain * throttle,
        pilot[1],
        pilot[2],
        target - z - ca.dot(theta[:3], pilot),
    )
    return ca.Function("f", [x, target, theta], [rate]), ca.Function("u", [x, theta], [stick])


def problem(ca, np, name, trials, solution):
    """The scaled NLP, its start at the solution, and the scale of theta."""
    abscissae, weights = SCHEMES[name]
    f, stick = joint(ca)
    scale_theta = np.abs(np.array(solution["theta"]))
    states = [np.array(run["states"]).T for run in solution["runs"]]
    scale = np.max([np.abs(x).max(axis=1) for x in states], axis=0)
    theta_bar = ca.MX.sym("theta", 6)
    theta = theta_bar * scale_theta
    variables, start, lower, upper = [theta_bar], [np.sign(solution["theta"])], [], []
    lower.append(np.full(6, -np.inf))
    upper.append(np.full(6, np.inf))
    defects, sticks, objective = [], [], 0
    for j, (trial, x0) in enumerate(zip(trials, states)):
        time, target = np.array(trial["time"]), np.array(trial["target"])
        h = np.diff(time)
        n = len(h)
        boundary = ca.MX.sym(f"x{j}", 9, n + 1)
        inner = [ca.MX.sym(f"m{j}_{i}", 9, n) for i in range(len(weights) - 1)]
        at = [c * target[1:] + (1 - c) * target[:-1] for c in abscissae]
        nodes = [boundary[:, :-1], *inner, boundary[:, 1:]]
        physical = [ca.diag(scale) @ x for x in nodes]
        rates = [f.map(n)(x, ca.DM(w).T, ca.repmat(theta, 1, n)) for x, w in zip(physical, at)]
        for i, row in enumerate(weights):
            change = sum(a * rate for a, rate in zip(row, rates) if a != 0)
            defect = physical[i + 1] - physical[0] - change * ca.repmat(ca.DM(h).T, 9, 1)
            defects.append(ca.vec(ca.diag(1 / scale) @ defect))
        sticks.append(stick.map(n + 1)(ca.diag(scale) @ boundary, ca.repmat(theta, 1, n + 1)).T)
        objective += ca.sumsqr(ca.DM(trial["position"]) - boundary[0, :].T * scale[0])
        # Start: midpoints by Hermite's cubic.
        rate0 = np.array(f.map(n + 1)(x0, ca.DM(target).T, ca.repmat(solution["theta"], 1, n + 1)))
        middle = (x0[:, 1:] + x0[:, :-1]) / 2 + h / 8 * (rate0[:, :-1] - rate0[:, 1:])
        for x, value in [(boundary, x0), *[(m, middle) for m in inner]]:
            variables.append(ca.vec(x))
            start.append((value / scale[:, None]).T.ravel())
            lower.append(np.full(value.size, -np.inf))
            upper.append(np.full(value.size, np.inf))
            if x is boundary:  # hover at the first recorded position, the pilot at zero
                first = np.array([trial["position"][0], *[0] * 8]) / scale
                lower[-1][:9] = upper[-1][:9] = start[-1][:9] = first
    stable = ca.vertcat(theta[0], theta[1], theta[2], theta[2] * theta[1] - theta[0]) - MARGIN
    equal, bounded = ca.vertcat(*defects), ca.vertcat(*sticks)
    g = ca.vertcat(equal, bounded, stable)
    zero, one = np.zeros(equal.numel()), np.ones(bounded.numel())
    nlp = {"x": ca.vertcat(*variables), "f": objective, "g": g}
    limits = {
        "lbx": np.concatenate(lower),
        "ubx": np.concatenate(upper),
        "lbg": np.concatenate([zero, -one, np.zeros(4)]),
        "ubg": np.concatenate([zero, one, np.full(4, np.inf)]),
    }
    return nlp, np.concatenate(start), limits, scale_theta


def kkt(ca, np, nlp, limits, found):
    """Stationarity, violation, complementarity, scaled as in Wächter & Biegler 2006, eq. 5."""
    multipliers = ca.MX.sym("m", nlp["g"].numel())
    lagrangian = nlp["f"] + ca.dot(multipliers, nlp["g"])
    gradient = ca.Function("l", [nlp["x"], multipliers], [ca.gradient(lagrangian, nlp["x"])])
    dual = np.array(gradient(found["x"], found["lam_g"]) + found["lam_x"]).ravel()
    g, lam = np.array(found["g"]).ravel(), np.array(found["lam_g"]).ravel()
    outside = np.maximum(limits["lbg"] - g, g - limits["ubg"]).max()
    inequality = limits["lbg"] < limits["ubg"]
    distance = np.where(lam > 0, limits["ubg"] - g, g - limits["lbg"])[inequality]
    product = np.abs(lam[inequality]) * np.where(np.isfinite(distance), distance, 1)
    scale = lambda lam: max(np.abs(lam).mean(), 100) / 100
    parts = [np.abs(dual).max() / scale(lam), outside, product.max() / scale(lam[inequality])]
    return [float(part) for part in parts]


def solve(ca, np, name, trials, solution):
    nlp, start, limits, scale_theta = problem(ca, np, name, trials, solution)
    solver = ca.nlpsol("solver", "ipopt", nlp, {"ipopt": IPOPT, "print_time": False})
    out = {"pilotage": {"objective": solution["objective"], "theta": solution["theta"]}}
    off = start.copy()
    off[:6] *= OFFSET
    for label, x0 in [("from the solution", start), ("from 2 % off", off)]:
        found = solver(x0=x0, **limits)
        stats = solver.stats()
        out[label] = {
            "status": stats["return_status"],
            "iterations": stats["iter_count"],
            "objective": float(found["f"]),
            "theta": [float(t) for t in np.array(found["x"]).ravel()[:6] * scale_theta],
            "kkt": kkt(ca, np, nlp, limits, found),
        }
        print(name, label, out[label], flush=True)
    out["unknowns"] = int(nlp["x"].numel())
    return out


def main():
    own_environment()
    import casadi as ca
    import numpy as np

    folder = ROOT / "examples" / "trials"
    solutions = json.loads((HERE / "solution.json").read_text())
    result = {
        "commands": [
            "cargo bench --bench solve -- --solution tests/casadi/solution.json",
            "python3 tests/casadi/compare.py",
        ],
        "casadi": ca.__version__,
        "ipopt_options": IPOPT,
        "schemes": {},
    }
    for name, solution in solutions.items():
        trials = [read_trial(folder / f"{run['name']}.csv") for run in solution["runs"]]
        result["schemes"][name] = solve(ca, np, name, trials, solution)
    (HERE / "result.json").write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
