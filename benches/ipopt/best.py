"""The best objectives that IPOPT finds on the data sets of benches/starts, from our default starts, in the
form that the study merges. From the repository's root; an hour on one core:

    python3 benches/ipopt/best.py target/best/ipopt.json
    cargo bench --bench starts -- --best target/best/ipopt.json

IPOPT runs at its fastest setting with the exact Hessian (solvers.py), on one thread. An end where the
constraints hold counts even where IPOPT did not converge: it is no optimum, but the least known is not
above it.
"""

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import race
from race import ROOT, build, environment

FEASIBLE = 1e-6  # violation of the scaled constraints, as in benches/starts


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("output", type=Path, metavar="FILE", help="JSON, written after each data set")
    add("--pilots", nargs="+", metavar="NAME", help="these humans of the study alone")
    add("--data-sets", type=int, default=10, metavar="N", help="of each human (10)")
    add("--starts", type=int, default=3, metavar="N", help="default starts of each (3)")
    add("--scheme", default="trapezoid", choices=["euler", "trapezoid", "hermite-simpson"])
    add("--initial-state", default="at-rest", choices=["free", "vehicle-at-rest", "at-rest"])
    add("--max-iter", type=int, default=600, metavar="N", help="of a solve (600)")
    add("--max-seconds", type=float, default=20, metavar="S", help="processor time of a solve (20)")
    return parser.parse_args()


def data_sets(options):
    """The study's flights as files: pilot, seed and manifest of each data set."""
    folder = ROOT / "target" / "best" / "flights"
    command = ["cargo", "bench", "-q", "--bench", "starts", "--", "--flights", folder]
    command.append(f"--data-sets={options.data_sets}")
    subprocess.run(command, cwd=ROOT, check=True)
    sets = json.loads((folder / "sets.json").read_text())
    known = {data["pilot"] for data in sets}
    if unknown := set(options.pilots or []) - known:
        raise SystemExit(f"no human of the study is called {', '.join(unknown)}; {sorted(known)} are")
    for data in sets:
        if not options.pilots or data["pilot"] in options.pilots:
            yield data | {"manifest": folder / data["manifest"]}


def solves(ours, data, options):
    """IPOPT from each default start of a data set."""
    from cases import cases
    from solvers import Ipopt, fastest, problem_of

    limits = options.max_iter, options.max_seconds
    each = options.initial_state, options.starts
    for case in cases(ours, [data["manifest"]], [options.scheme], *each):
        answer = ours.ask(case)
        problem = problem_of(case, answer)
        solve = Ipopt(problem, "exact", fastest(options.scheme), *limits).solve(answer["start"])
        yield {"start": case["start"]} | solve


def entry(data, found, options):
    """A data set in the study's form; `best` is None where no solve ended at a feasible point."""
    feasible = [s["objective"] for s in found if s["violation"] <= FEASIBLE]
    return {
        "initial_state": options.initial_state,
        "scheme": options.scheme,
        "pilot": data["pilot"],
        "seed": data["seed"],
        "best": min(filter(math.isfinite, feasible), default=None),
        "solves": found,
    }


def main():
    options = arguments()
    for name in race.ONE_THREAD:
        os.environ[name] = "1"
    environment.enter()
    from solvers import Ours

    # Ours only says where it would start.
    ours = Ours(build()["race"], max_iterations=0, max_seconds=1, repeats=1)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    entries = []
    for data in data_sets(options):
        found = list(solves(ours, data, options))
        entries.append(entry(data, found, options))
        options.output.write_text(json.dumps(entries, indent=1) + "\n")
        ends = ", ".join(f"{s['status']} {s['iterations']} {s['seconds']:.1f} s" for s in found)
        best = entries[-1]["best"]
        known = "-" if best is None else f"{best:.6f}"
        print(f"{data['pilot']:<12} {data['seed']:>3} {known:>14}  {ends}", flush=True)
    converged = sum(any(s["converged"] for s in e["solves"]) for e in entries)
    print(f"IPOPT converged from one start at least on {converged} of {len(entries)} data sets")


if __name__ == "__main__":
    sys.exit(main())
