"""The race on problem files: from the model files' own values, and from others near them."""

import statistics

import humans
import numpy as np
from loops import CASES
from posed import Posed
from solvers import Ipopt, judge

SAME_START = 1e-8  # relative difference of the objectives at the start
# IPOPT at its fastest, found by study.py for each problem.
FASTEST = {name: {"mumps_pivot_order": 5, "nlp_scaling_method": "none"} for name in ("precision", "hover", "tracking")}

HEAD = (
    "problem    start    unknowns | IPOPT: status                 iter.  seconds          objective | "
    "ours: status    iter.  seconds          objective |  ratio"
)
TABLE = (
    "problem    unknowns | ours: s a solve  ms an iteration  converged | IPOPT: s a solve  ms an iteration  converged | "
    "ratio   least | best objective: ours, IPOPT"
)


def cases(root, names, count):
    """Each problem with its folder and the problem file of each start."""
    for case in CASES:
        if case.name in names:
            folder = root / "target" / "race" / "problems" / case.name
            yield case, folder, humans.write(case, folder, count)


def posed(case, folder, answer):
    """The problem in CasADi; it is the same only with the same objective at the start."""
    problem = Posed(case, folder, answer, answer["scales"])
    x = problem.nlp["x"]
    nothing = np.zeros(problem.nlp["g"].numel()), np.zeros(x.numel())
    there, here = problem.kkt(answer["start"], *nothing)[0], answer["start_objective"]
    if abs(there - here) > SAME_START * abs(here):
        raise SystemExit(f"{case.name}: the objective at the start is {here} here, {there} in CasADi")
    return problem


def solve(ours, case, folder, file, options):
    """One start: ours, IPOPT's and ours again."""
    request = {"problem": str(file)}
    answers = [ours.ask(request)]
    problem = posed(case, folder, answers[0])
    limits = options.max_iter, options.max_seconds
    peer = Ipopt(problem, "exact", FASTEST[case.name], *limits).solve(answers[0]["start"])
    answers.append(ours.ask(request))
    if answers[0]["end_scales"] != answers[0]["scales"]:
        problem = Posed(case, folder, answers[0], answers[0]["end_scales"])
    return {
        "problem": case.name,
        "start": file.stem,
        "unknowns": len(answers[0]["start"]),
        "parameters": answers[0]["parameters"],
        "ours": judge(problem, answers),
        "ipopt": peer,
    }


def both(row):
    return row["ours"]["converged"] and row["ipopt"]["converged"]


def ratio(row):
    return row["ipopt"]["seconds"] / row["ours"]["seconds"]


def objective(solve):
    text = f"{solve['objective']:.9f}"
    return f"{text if solve['converged'] else '(' + text + ')':>18}"


def line(row):
    ours, peer = row["ours"], row["ipopt"]
    status = ours["status"] + ("" if ours["confirmed"] or not ours["converged"] else " (no!)")
    value = f"{ratio(row):.1f}" if both(row) else "-"
    return (
        f"{row['problem']:<10} {row['start']:<8} {row['unknowns']:>8} | {peer['status']:<28} {peer['iterations']:>6} "
        f"{peer['seconds']:>8.2f} {objective(peer)} | {status:<15} {ours['iterations']:>5} {ours['seconds']:>8.3f} "
        f"{objective(ours)} | {value:>6}"
    )


def summary(rows, same):
    """The table, and where ours is worse than IPOPT's from the same start."""
    lines = [TABLE, "-" * len(TABLE)]
    for name in dict.fromkeys(row["problem"] for row in rows):
        lines.append(of_problem([row for row in rows if row["problem"] == name]))
    limit = lambda row: row["ipopt"]["objective"] * (1 + same)
    worse = [row for row in rows if both(row) and row["ours"]["objective"] > limit(row)]
    lower = [row for row in rows if both(row) and row["ours"]["objective"] * (1 + same) < row["ipopt"]["objective"]]
    name = lambda row: f"{row['problem']} {row['start']}"
    lines += [
        "seconds are the processor's, medians over the starts that converged; the ratio is that of the starts where "
        "both did",
        f"both converged and ours is worse: {', '.join(map(name, worse)) or 'nowhere'}; ours is lower: "
        f"{', '.join(map(name, lower)) or 'nowhere'}",
        f"confirmed by CasADi: {sum(row['ours']['confirmed'] for row in rows)} of "
        f"{sum(row['ours']['converged'] for row in rows)} of our converged solves",
    ]
    return "\n".join(lines)


def of_problem(rows):
    ratios = [ratio(row) for row in rows if both(row)]
    solver = lambda key: " ".join(figures([row[key] for row in rows]))
    ends = [min((r[k]["objective"] for r in rows if r[k]["converged"]), default=np.nan) for k in ("ours", "ipopt")]
    value = f"{statistics.median(ratios):>5.1f} {min(ratios):>7.1f}" if ratios else f"{'-':>5} {'-':>7}"
    return (
        f"{rows[0]['problem']:<10} {rows[0]['unknowns']:>8} | {solver('ours')} | {solver('ipopt')}  | {value} | "
        f"{ends[0]:.9f}, {ends[1]:.9f}"
    )


def figures(solves):
    """Seconds a solve, milliseconds an iteration, how many converged."""
    done = [s["seconds"] for s in solves if s["converged"]]
    each = statistics.median(1e3 * s["seconds"] / max(s["iterations"], 1) for s in solves)
    yield f"{statistics.median(done):>15.3f}" if done else f"{'-':>15}"
    yield f"{each:>16.1f}"
    yield f"{len(done):>7} of {len(solves)}"


def race(ours, root, options, same, write):
    """Every problem from every start; whether CasADi confirms what we call converged, and IPOPT is never better."""
    rows = []
    print(HEAD + "\n" + "-" * len(HEAD), flush=True)
    for case, folder, files in cases(root, options.problems, options.starts):
        for file in files.values():
            rows.append(solve(ours, case, folder, file, options))
            print(line(rows[-1]), flush=True)
            write(rows)
    print("\n" + summary(rows, same))
    return all(row["ours"]["confirmed"] or not row["ours"]["converged"] for row in rows)
