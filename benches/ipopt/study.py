"""Which setting of IPOPT is the fastest on the race's problems. From the repository's root, after a race
has made its data sets:

    python3 benches/ipopt/study.py --data-sets 2 3 --starts 4
    python3 benches/ipopt/study.py --problems tracking --starts 1    of a problem file

Each setting solves the same cases; printed are how many converged, the median over the cases of its
time relative to the first setting's, and the time of an iteration. solvers.py has the fastest.
"""

import argparse
import os
import statistics
import sys

import race
from race import ROOT, build, environment

METIS = {"mumps_pivot_order": 5}
SCALED = METIS | {"nlp_scaling_method": "none"}
# name: Hessian, options
SETTINGS = {
    "METIS, no scaling": ("exact", SCALED),
    "IPOPT's defaults": ("exact", {}),
    "METIS": ("exact", METIS),
    "AMD": ("exact", SCALED | {"mumps_pivot_order": 0}),
    "AMF": ("exact", SCALED | {"mumps_pivot_order": 2}),
    "PORD": ("exact", SCALED | {"mumps_pivot_order": 4}),
    "QAMD": ("exact", SCALED | {"mumps_pivot_order": 6}),
    "no permuting": ("exact", SCALED | {"mumps_permuting_scaling": 0}),
    "no permuting, no scaling in MUMPS": (
        "exact",
        SCALED | {"mumps_permuting_scaling": 0, "mumps_scaling": 0},
    ),
    "SPRAL": ("exact", {"nlp_scaling_method": "none", "linear_solver": "spral"}),
    "adaptive mu": ("exact", SCALED | {"mu_strategy": "adaptive"}),
    "adaptive mu, probing": ("exact", SCALED | {"mu_strategy": "adaptive", "mu_oracle": "probing"}),
    "mu from 1e-3": ("exact", SCALED | {"mu_init": 1e-3}),
    "mu from 1e-5": ("exact", SCALED | {"mu_init": 1e-5}),
    "fixed variables as constraints": (
        "exact",
        SCALED | {"fixed_variable_treatment": "make_constraint"},
    ),
    "no second-order corrections": ("exact", SCALED | {"max_soc": 0}),
    "Gauss-Newton": ("gauss-newton", SCALED),
    "Gauss-Newton, adaptive mu": ("gauss-newton", SCALED | {"mu_strategy": "adaptive"}),
    "limited memory": ("exact", SCALED | {"hessian_approximation": "limited-memory"}),
}


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--data-sets", type=int, nargs="+", default=[2, 3], metavar="N", help="of target/race (2 3)")
    add("--problems", nargs="+", metavar="NAME", help="problem files instead: precision hover tracking")
    add("--starts", type=int, default=4, metavar="N", help="of each (4)")
    add("--schemes", nargs="+", default=["euler", "trapezoid"])
    add("--initial-state", default="at-rest")
    add("--settings", nargs="+", default=list(SETTINGS), metavar="NAME", help=", ".join(SETTINGS))
    add("--max-iter", type=int, default=600, metavar="N")
    add("--max-seconds", type=float, default=60, metavar="S")
    return parser.parse_args()


def problems(options):
    """Every case in CasADi, with its start."""
    from cases import cases
    from solvers import Ours, problem_of

    ours = Ours(build()["race"], max_iterations=0, max_seconds=1, repeats=1)
    if options.problems:
        yield from posed(ours, options)
        return
    folder = ROOT / "target" / "race"
    manifests = [folder / f"set{n}" / "trials.toml" for n in options.data_sets]
    for case in cases(ours, manifests, options.schemes, options.initial_state, options.starts):
        answer = ours.ask(case)
        yield problem_of(case, answer), answer["start"]


def posed(ours, options):
    """Every problem file in CasADi, with its start."""
    from posed import Posed
    from problems import cases

    for case, folder, files in cases(ROOT, options.problems, options.starts):
        for file in files.values():
            answer = ours.ask({"problem": str(file)})
            yield Posed(case, folder, answer), answer["start"]


def main():
    options = arguments()
    for name in race.ONE_THREAD:
        os.environ[name] = "1"
    os.environ["OMP_CANCELLATION"] = os.environ["OMP_PROC_BIND"] = "true"  # SPRAL refuses without
    environment.enter()
    from solvers import Ipopt

    limits = options.max_iter, options.max_seconds
    found = {name: [] for name in options.settings}
    for problem, start in problems(options):
        for name in options.settings:
            hessian, setting = SETTINGS[name]
            solve = Ipopt(problem, hessian, setting, *limits).solve(start)
            found[name].append(solve)
            print(
                f"  {name:<35} {solve['status']:<28} {solve['iterations']:>5} "
                f"{solve['seconds']:>8.2f} s {solve['objective']:>16.9f}  "
                f"built in {solve['build_seconds']:.1f} s",
                flush=True,
            )
        print()
    first = found[options.settings[0]]
    print(f"{'setting':<35} converged  time relative  ms an iteration")
    for name, solves in found.items():
        pairs = [(s, f) for s, f in zip(solves, first) if s["converged"] and f["converged"]]
        relative = [s["seconds"] / f["seconds"] for s, f in pairs]
        each = statistics.median(1e3 * s["seconds"] / max(s["iterations"], 1) for s in solves)
        median = f"{statistics.median(relative):.2f}" if relative else "-"
        done = sum(s["converged"] for s in solves)
        print(f"{name:<35} {done:>3} of {len(solves):<3} {median:>14} {each:>16.1f}")


if __name__ == "__main__":
    sys.exit(main())
