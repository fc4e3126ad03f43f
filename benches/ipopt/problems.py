"""The race on problem files: from the model files' own values, and from others near them."""

import multiprocessing
import resource
import statistics

import casadi as ca
import humans
import numpy as np
from loops import CASES
from posed import Posed
from solvers import Ipopt, judge

SAME_PROBLEM = 1e-8  # relative difference of what is compared
PROBE = 0.1  # as in race.rs
# IPOPT at its fastest of what was tried: AMD, METIS, adaptive mu and its own scaling are slower or as fast.
FASTEST = {"mumps_pivot_order": 6, "nlp_scaling_method": "none"}

HEAD = (
    "problem    start    unknowns | IPOPT: status                 iter.  seconds          objective | "
    "ours: status      iter.  seconds          objective |  ratio"
)
TABLE = (
    "problem    unknowns | ours: s a solve  iterations  converged | IPOPT: s a solve  iterations  converged | "
    "ratio   least | best objective: ours, IPOPT"
)


def cases(root, names, count):
    """Each problem with its folder and the problem file of each start."""
    for case in CASES:
        if case.name in names:
            folder = root / "target" / "race" / "problems" / case.name
            yield case, folder, humans.write(case, folder, count)


def check(problem, answer):
    """Ends where the problem is another one in CasADi: by the objective and the squares of equalities and limited
    signals at a point near the start."""
    start = np.array(answer["start"])
    z = start + PROBE * np.sin(np.arange(len(start)))
    values = ca.Function("values", [problem.nlp[k] for k in "xp"], [problem.nlp[k] for k in "fg"])
    objective, g = (np.array(v).ravel() for v in values(z, problem.limits["p"]))
    defects, limited = np.split(g, [sum(problem.defects)])
    known = z[problem.limits["lbx"] == problem.limits["ubx"]]
    here = [objective[0], defects @ defects + known @ known, limited @ limited]
    if not np.allclose(here, answer["probe"], rtol=SAME_PROBLEM, atol=0):
        raise SystemExit(f"{problem.case.name}: {here} in CasADi, {answer['probe']} here")


def limited(peer, start, seconds):
    """IPOPT's solve in a process of its own, which is ended when it goes on well after its time: it looks at the clock
    between iterations alone, and one in which MUMPS swells takes minutes."""
    receiver, sender = multiprocessing.Pipe(duplex=False)
    most = round(1.5 * seconds)

    def work():
        resource.setrlimit(resource.RLIMIT_CPU, (most, most))
        sender.send(peer.solve(start))

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    sender.close()
    try:
        return receiver.recv()
    except EOFError:
        nothing = {"converged": False, "iterations": 0, "objective": float("nan")}
        return nothing | {"status": f"ended after {most} s", "seconds": float(most)}
    finally:
        process.join()


def solves(ours, case, folder, files, options):
    """Every start: ours, IPOPT's and ours again."""
    peer = None
    for name, file in files.items():
        request = {"problem": str(file), "at_once": options.at_once}
        answers = [ours.ask(request)]
        if peer is None:
            limits = options.max_iter, options.max_seconds
            peer = Ipopt(Posed(case, folder, answers[0]), "exact", FASTEST, *limits)
        peer.problem.set_scales(answers[0]["scales"])
        check(peer.problem, answers[0])
        found = limited(peer, answers[0]["start"], options.max_seconds)
        answers.append(ours.ask(request))
        peer.problem.set_scales(answers[0]["end_scales"])
        yield {
            "problem": case.name,
            "start": name,
            "unknowns": len(answers[0]["start"]),
            "parameters": answers[0]["parameters"],
            "ours": judge(peer.problem, answers),
            "ipopt": found,
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
        f"{peer['seconds']:>8.2f} {objective(peer)} | {status:<15} {ours['coarse_iterations']:>3}+{ours['iterations']:<3} {ours['seconds']:>8.3f} "
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
        "times are the processor's, medians over the starts that converged; the ratio is that of the starts where "
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
    """Seconds a solve, iterations (on the coarse mesh and the fine one), how many converged."""
    done = [s for s in solves if s["converged"]]
    median = lambda key: statistics.median(s[key] for s in done)
    yield f"{median('seconds'):>15.3f}" if done else f"{'-':>15}"
    coarse = f"{median('coarse_iterations'):.0f}+" if done and "coarse_iterations" in done[0] else ""
    yield f"{coarse + format(median('iterations'), '.0f'):>11}" if done else f"{'-':>11}"
    yield f"{len(done):>7} of {len(solves)}"


def race(ours, root, options, same, write):
    """Every problem from every start; whether CasADi confirms what we call converged."""
    rows = []
    print(HEAD + "\n" + "-" * len(HEAD), flush=True)
    for case, folder, files in cases(root, options.problems, options.starts):
        for row in solves(ours, case, folder, files, options):
            rows.append(row)
            print(line(rows[-1]), flush=True)
            write(rows)
    print("\n" + summary(rows, same))
    return all(row["ours"]["confirmed"] or not row["ours"]["converged"] for row in rows)
