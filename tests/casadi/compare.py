"""Solves pilotage's identification problem with CasADi and IPOPT, from pilotage's solution.

The NLP is a second one (nlp.py); nothing but the start is taken from pilotage. Run from the
repository's root:

    cargo bench --bench solve -- --solution tests/casadi/solution.json
    python3 tests/casadi/compare.py

It makes a virtual environment in .venv/casadi with requirements.txt, solves the problem with each
scheme from two starts, the solution as it is and one with every parameter 2 % off, and writes
tests/casadi/result.json.
"""

import json

import environment

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


def start(problem, trials, states, theta):
    """The unknowns from the states at the samples; midpoints by Hermite's cubic."""
    import numpy as np

    parts = []
    for trial, x in zip(trials, states):
        h, nodes = np.diff(trial.time), x
        if len(problem.weights) == 2:
            n = len(trial.time)
            rates = np.array(problem.f.map(n)(x, trial.target, np.tile(theta, (n, 1)).T))
            middle = (x[:, 1:] + x[:, :-1]) / 2 + h / 8 * (rates[:, :-1] - rates[:, 1:])
            nodes = np.empty((len(x), 2 * len(h) + 1))
            nodes[:, ::2], nodes[:, 1::2] = x, middle
        parts.append((nodes / problem.scale[:, None]).T.ravel())
    z = np.concatenate([*parts, theta / problem.scale_theta])
    fixed = problem.limits["lbx"] == problem.limits["ubx"]
    return np.where(fixed, problem.limits["lbx"], z)


def solve(name, trials, solution):
    import casadi as ca
    import numpy as np
    from nlp import Problem

    theta = np.array(solution["theta"])
    states = [np.array(run["states"]) for run in solution["runs"]]
    scale = np.max([np.abs(x).max(axis=1) for x in states], axis=0)
    problem = Problem(name, "at-rest", trials, scale, np.abs(theta))
    solver = ca.nlpsol("solver", "ipopt", problem.nlp, {"ipopt": IPOPT, "print_time": False})
    out = {"pilotage": {"objective": solution["objective"], "theta": solution["theta"]}}
    z = start(problem, trials, states, theta)
    off = z.copy()
    off[-len(theta) :] *= OFFSET
    for label, x0 in [("from the solution", z), ("from 2 % off", off)]:
        found = solver(x0=x0, **problem.limits)
        stats = solver.stats()
        out[label] = {
            "status": stats["return_status"],
            "iterations": stats["iter_count"],
            "objective": float(found["f"]),
            "theta": (np.array(found["x"]).ravel()[-len(theta) :] * problem.scale_theta).tolist(),
            "kkt": problem.kkt(found["x"], found["lam_g"], found["lam_x"])[1],
        }
        print(name, label, out[label], flush=True)
    out["unknowns"] = len(z)
    return out


def main():
    environment.enter()
    import casadi as ca
    from trials import read_trial

    folder = environment.ROOT / "examples" / "trials"
    solutions = json.loads((environment.HERE / "solution.json").read_text())
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
        result["schemes"][name] = solve(name, trials, solution)
    (environment.HERE / "result.json").write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
