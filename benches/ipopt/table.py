"""What the race prints."""

import math
import statistics

HEAD = (
    "data set   start      scheme          | IPOPT: Hessian, status                    iter.  "
    "seconds     objective [m²] | ours: status      iter.  seconds     objective [m²] |  ratio"
)


def header():
    return HEAD + "\n" + "-" * len(HEAD)


def row(case):
    lines = []
    ours = case["ours"]
    for i, (hessian, peer) in enumerate(case["ipopt"].items()):
        mark = "*" if hessian == case["counts"] else " "
        left = f"{case['data_set']:<10} {case['start']:<10} {case['scheme']:<15} "
        right = f" {name(ours):<15} {ours['iterations']:>6} {ours['seconds']:>8.3f} "
        right += f"{objective(ours)} | "
        value = ratio(case)
        right += f"{value:>6.1f}" if value is not None else "     -"
        lines.append(
            f"{left if i == 0 else ' ' * len(left)}| {mark}{hessian:<13} {peer['status']:<28} "
            f"{peer['iterations']:>5} {peer['seconds']:>8.2f} {objective(peer)} |"
            + (right if i == 0 else "")
        )
    return "\n".join(lines)


def objective(solve):
    """In brackets where it is that of no solution."""
    text = f"{solve['objective']:.9f}"
    return f"{text if solve['converged'] else '(' + text + ')':>18}"


def name(ours):
    return ours["status"] + ("" if ours["confirmed"] or not ours["converged"] else " (no!)")


def ratio(case):
    """IPOPT's time over ours where IPOPT converged; zero where we did not."""
    if case["counts"] is None:
        return None
    ours = case["ours"]
    return case["ipopt"][case["counts"]]["seconds"] / ours["seconds"] if ours["converged"] else 0.0


def summary(rows, same):
    """Medians, how often each converged, and who ended lower."""
    ratios = [value for value in map(ratio, rows) if value is not None]
    ours = [case["ours"] for case in rows]
    converged = [o["seconds"] for o in ours if o["converged"]]
    lines = ["seconds are the processor's; * marks the Hessian that counts; brackets: no solution"]
    if ratios:
        below = sum(value < 50 for value in ratios)
        lines += [
            f"ratio IPOPT / ours, median of {len(ratios)} cases where IPOPT converged: "
            f"{statistics.median(ratios):.1f} (least {min(ratios):.1f}; {below} below 50)"
        ]
        wall = [
            case["ipopt"][case["counts"]]["wall_seconds"] / case["ours"]["wall_seconds"]
            for case in rows
            if ratio(case)
        ]
        if wall:
            lines += [f"the same by the clock on the wall: {statistics.median(wall):.1f}"]
    for hessian in rows[0]["ipopt"]:
        peer = [case["ipopt"][hessian] for case in rows]
        done = sum(p["converged"] for p in peer)
        building = statistics.median(p["build_seconds"] for p in peer)
        lines += [
            f"IPOPT, {hessian}: {done} of {len(rows)} converged; {milliseconds(peer)} an iteration; "
            f"building its functions took {building:.1f} s each time, not counted"
        ]
    lines += [f"ours: {len(converged)} of {len(rows)} converged; {milliseconds(ours)} an iteration"]
    if converged:
        lines[-1] += (
            f"; a solve {1e3 * statistics.median(converged):.0f} ms (median), "
            f"{1e3 * max(converged):.0f} ms (largest)"
        )
    alone = sum(case["counts"] is not None and not case["ours"]["converged"] for case in rows)
    lines += [f"cases where IPOPT converged and ours did not (ratio 0): {alone}"]
    confirmed = sum(o["converged"] and o["confirmed"] for o in ours)
    lines += [f"confirmed by CasADi: {confirmed} of our {len(converged)} converged solves"]
    return "\n".join(lines + objectives(rows, same))


def milliseconds(solves):
    each = [s["seconds"] / s["iterations"] for s in solves if s["iterations"]]
    return f"{1e3 * statistics.median(each):.2f} ms" if each else "-"


def objectives(rows, same):
    """The best over the starts, for each data set and scheme."""
    groups = {}
    for case in rows:
        groups.setdefault((case["data_set"], case["scheme"]), []).append(case)
    lines, worse = [], 0
    for (data_set, scheme), group in groups.items():
        best = lambda solves: min((s["objective"] for s in solves if s["converged"]), default=math.inf)
        ours = best(case["ours"] for case in group)
        peer = best(p for case in group for p in case["ipopt"].values())
        if math.isinf(ours) and math.isinf(peer):
            verdict = "neither converged"
        elif ours > peer * (1 + same):
            verdict, worse = "OURS IS WORSE", worse + 1
        else:
            verdict = "ours is lower" if ours < peer * (1 - same) else "the same"
        lines += [f"  {data_set:<10} {scheme:<15} IPOPT {peer:.9f}  ours {ours:.9f}  {verdict}"]
    return [f"best over the starts; ours is worse in {worse} of {len(groups)}:", *lines]
