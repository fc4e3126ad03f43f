"""pilotage against CasADi and IPOPT on the same problem: data, scheme, constraints, scaling, start and
tolerance of the scaled KKT residual (1e-8), one thread each. From the repository's root:

    python3 benches/ipopt/race.py                                  5 data sets, 4 starts, 2 schemes
    python3 benches/ipopt/race.py --data-sets 2 --schemes euler    a short one
    python3 benches/ipopt/race.py --trials runs/trials.toml --theta pilot.toml
                                                                   both solvers from that pilot's theta
    python3 benches/ipopt/race.py --problems                       problem files: precision, hover, tracking
    python3 benches/ipopt/race.py --problems hover --starts 2      a short one of them
    python3 benches/ipopt/race.py --problems hover --at-once       ours without the coarse mesh first
    python3 benches/ipopt/race.py --problems --default-starts 20   how often fits as they come find the best

It makes a virtual environment with CasADi in .venv/casadi, builds race.rs and lets synthetic humans fly
into target/race. A solve of ours stands between two of IPOPT's, so that a busy machine hits both, and
seconds are the processor's. IPOPT runs at its fastest setting (solvers.py; study.py is where that comes
from), once with the exact Hessian and once with Gauss-Newton's; the faster that converges counts. The
building of its functions is not counted. What our solver calls converged is confirmed in CasADi with
the multipliers that it found; the exit code is 1 when one is not.

Trials of one's own must have been flown with the default vehicle: nlp.py has its numbers.

The samples are the mesh; ours is solved on a fifth of it first, as fits are, which counts. The default starts of flights are
those that a fit draws.

Problem files are raced (problems.py) from the values of the model files and from others within a factor 3, with one
start each; their equations in CasADi are in loops.py. IPOPT has the exact Hessian. With --default-starts there is no
race: each is fitted from so many given starts by the command with its default starts (defaults.py), and the exit code is
1 where fewer than nine of ten end within 0.1 % of the best.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "casadi"))

import environment

SAME_OBJECTIVE = 1e-6  # relative
ONE_THREAD = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--data-sets", type=int, default=5, metavar="N", help="synthetic data sets (5)")
    add("--trials", type=Path, nargs="+", metavar="MANIFEST", help="these data sets instead")
    add("--problems", nargs="*", metavar="NAME", help="problem files instead: all, or those called so")
    add("--starts", type=int, metavar="N", help="the default ones, then random ones (4; of problem files 5)")
    add("--default-starts", type=int, metavar="N", help="no race: so many fits of each problem file")
    add("--at-once", action="store_true", help="ours on the mesh alone, without a coarser one first")
    add("--theta", type=Path, nargs="+", metavar="FILE", help="these starts instead: TOML or JSON")
    add("--schemes", nargs="+", default=["euler", "trapezoid"], metavar="SCHEME",
        choices=["euler", "trapezoid", "hermite-simpson"], help="euler and trapezoid")
    add("--initial-state", default="at-rest", choices=["free", "vehicle-at-rest", "at-rest"])
    add("--hessians", nargs="+", default=["exact", "gauss-newton"], metavar="HESSIAN",
        choices=["exact", "gauss-newton"], help="of IPOPT: exact and gauss-newton")
    add("--max-iter", type=int, default=600, metavar="N", help="of a solve, for both (600)")
    add("--max-seconds", type=float, default=120, metavar="S", help="of a solve, for both (120)")
    add("--repeats", type=int, default=3, metavar="N", help="of ours, around each of IPOPT's (3)")
    add("--json", type=Path, metavar="FILE", help="write everything there")
    options = parser.parse_args()
    options.starts = options.starts or (4 if options.problems is None else 5)
    return options


def build():
    """Builds race.rs, and with it the command; the path of each program."""
    command = ["cargo", "bench", "--bench", "race", "--no-run"]
    command.append("--message-format=json-render-diagnostics")
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    return {m["target"]["name"]: m["executable"] for m in messages if m.get("executable")}


def run_case(ours, case, options):
    """One start: ours and IPOPT's by turns."""
    from solvers import Ipopt, fastest, judge, problem_of

    limits = options.max_iter, options.max_seconds
    request = case | {"at_once": options.at_once}
    answers = [ours.ask(request)]
    problem = problem_of(case, answers[0])
    peer = {}
    for hessian in options.hessians:
        solver = Ipopt(problem, hessian, fastest(case["scheme"]), *limits)
        peer[hessian] = solver.solve(answers[0]["start"])
        answers.append(ours.ask(request))
    ended = problem_of(case, answers[0], "end_scales")
    converged = [h for h in peer if peer[h]["converged"]]
    best = min(converged, key=lambda h: peer[h]["seconds"]) if converged else None
    return case | {
        "unknowns": len(answers[0]["start"]),
        "ours": judge(ended, answers),
        "ipopt": peer,
        "counts": best,
    }


def named_problems(options):
    """The problem files that are asked for; all where none is named."""
    from loops import CASES

    known = [case.name for case in CASES]
    names = options.problems or known
    if unknown := set(names) - set(known):
        raise SystemExit(f"no problem is called {', '.join(unknown)}; {', '.join(known)} are")
    return names


def race_problems(ours, options):
    import problems

    def write(rows):
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1) + "\n")

    options.problems = named_problems(options)
    sys.exit(not problems.race(ours, ROOT, options, SAME_OBJECTIVE, write))


def main():
    options = arguments()
    for name in ONE_THREAD:
        os.environ[name] = "1"
    environment.enter()
    import table
    from cases import cases, fly, read_theta
    from solvers import Ours

    programs = build()
    if options.default_starts:
        import defaults

        names = named_problems(options)
        sys.exit(not defaults.count(programs["pilotage"], ROOT, names, options.default_starts))
    ours = Ours(programs["race"], options.max_iter, options.max_seconds, options.repeats)
    if options.problems is not None:
        return race_problems(ours, options)
    manifests, thetas = options.trials, None
    if not manifests:
        folder = ROOT / "target" / "race"
        manifests = [fly(programs["pilotage"], folder, n) for n in range(options.data_sets)]
    if options.theta:
        thetas = [(path.stem, read_theta(path)) for path in options.theta]
    rows = []
    print(table.header(), flush=True)
    for case in cases(
        ours, manifests, options.schemes, options.initial_state, options.starts, thetas
    ):
        rows.append(run_case(ours, case, options))
        print(table.row(rows[-1]), flush=True)
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1) + "\n")
    print("\n" + table.summary(rows, SAME_OBJECTIVE))
    sys.exit(any(row["ours"]["converged"] and not row["ours"]["confirmed"] for row in rows))


if __name__ == "__main__":
    main()
