"""The two solvers of the race, each on one thread."""

import json
import os
import statistics
import subprocess
import time
from pathlib import Path

import casadi as ca
import numpy as np
from nlp import Problem
from trials import read_manifest

# IPOPT at its best: the ordering of MUMPS that study.py found the fastest for the scheme (0 AMD, 5 METIS,
# 6 QAMD). Scaling is off since the problem comes scaled, and so that both tolerances mean the same.
ORDERING = {"euler": 0, "trapezoid": 6, "hermite-simpson": 5}


def fastest(scheme):
    return {"mumps_pivot_order": ORDERING[scheme], "nlp_scaling_method": "none"}


TOLERANCE = 1e-8  # of the scaled KKT residual, for both
ROUNDING = 1.1  # what another order of summation may add to the residual, as a factor
QUIET = {"print_level": 0, "sb": "yes"}


def problem_of(case, answer, scales="scales"):
    """The NLP of a case in CasADi, with our solver's scales."""
    trials = read_manifest(Path(case["manifest"]))
    names, scales = (case["scheme"], case["initial_state"]), answer[scales]
    return Problem(*names, trials, scales["states"], scales["parameters"], *answer["bound_sizes"])


class Ours:
    """race.rs, a process that answers one request at a time."""

    def __init__(self, program, max_iterations, max_seconds, repeats):
        self.options = {
            "max_iterations": max_iterations,
            "max_seconds": max_seconds,
            "tolerance": TOLERANCE,
            "repeats": repeats,
        }
        one_thread = os.environ | {"RAYON_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=one_thread
        )

    def ask(self, request):
        self.process.stdin.write(json.dumps(self.options | request) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        answer = json.loads(line) if line else {"error": "it ended without an answer"}
        if "error" in answer:
            raise SystemExit(f"race.rs: {answer['error']}; the request was {request}")
        return answer


def judge(problem, answers):
    """Our solve: the median of its repetitions, its residual according to CasADi."""
    # JSON has no NaN: where a value is not finite, there is None.
    last = answers[-1]
    for key in ("z", "lambda", "eta", "objective", "kkt"):
        last[key] = np.array(last[key], float)
    lam_g, lam_x = problem.multipliers(last["lambda"], last["eta"])
    objective, parts = problem.kkt(last["z"], lam_g, lam_x)
    converged = last["status"] == "converged"
    same = abs(objective - last["objective"]) <= 1e-9 * abs(objective)
    keep = ("status", "iterations", "coarse_iterations", "theta", "setup_seconds")
    return {key: last[key] for key in keep if key in last} | {
        "objective": float(last["objective"]),
        "kkt": float(last["kkt"]),
        "seconds": statistics.median(s for a in answers for s in a["seconds"]),
        "wall_seconds": statistics.median(s for a in answers for s in a["wall_seconds"]),
        "converged": converged,
        "kkt_by_casadi": max(parts),
        "confirmed": bool(same and max(parts) <= ROUNDING * TOLERANCE),
    }


class Ipopt:
    """IPOPT on a Problem of nlp.py, with CasADi's functions expanded to scalar operations."""

    def __init__(self, problem, hessian, options, max_iterations, max_seconds):
        self.problem = problem
        limits = {
            "tol": TOLERANCE,
            "acceptable_iter": 0,  # no end at 1e-6: in a flat valley that is no solution
            "max_iter": max_iterations,
            "max_cpu_time": max_seconds,
        }
        clock = time.process_time()
        settings = {"ipopt": QUIET | limits | options, "print_time": False, "expand": True}
        if hessian == "gauss-newton":
            settings["hess_lag"] = gauss_newton(problem)
        self.solver = ca.nlpsol("solver", "ipopt", problem.nlp, settings)
        self.build_seconds = time.process_time() - clock

    def solve(self, start):
        clock, wall = time.process_time(), time.perf_counter()
        found = self.solver(x0=start, **self.problem.limits)
        seconds, wall = time.process_time() - clock, time.perf_counter() - wall
        stats = self.solver.stats()
        objective, parts = self.problem.kkt(found["x"], found["lam_g"], found["lam_x"])
        theta = np.array(found["x"]).ravel()[-len(self.problem.scale_theta) :]
        return {
            "status": stats["return_status"],
            "converged": stats["return_status"] == "Solve_Succeeded",
            "iterations": stats["iter_count"],
            "seconds": seconds,
            "wall_seconds": wall,
            "build_seconds": self.build_seconds,
            "objective": objective,
            "kkt": max(parts),
            "violation": parts[1],
            "theta": (theta * self.problem.scale_theta).tolist(),
        }


def gauss_newton(problem):
    """The Hessian of the Lagrangian replaced by that of the objective, which is diagonal here."""
    n, m = problem.nlp["x"].numel(), problem.nlp["g"].numel()
    x, p, g = ca.SX.sym("x", n), ca.SX.sym("p", 0), ca.SX.sym("lam_g", m)
    f = ca.SX.sym("lam_f")
    hessian = f * ca.diag(ca.sparsify(ca.DM(problem.gauss_newton)))
    names = ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
    return ca.Function("nlp_hess_l", [x, p, f, g], [hessian], *names)
