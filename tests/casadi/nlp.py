"""pilotage's identification problem in CasADi, written a second time from docs/method.md and the
published schemes. It shares with pilotage the order of the unknowns and constraints, so that starts and
multipliers can be exchanged:

    z = [X1 | X2 | ... | theta]    a run: its nodes in time order, all states of a node together, the pilot's first; scaled
    g = [defects | sticks | stability]    each run by run; defects interval by interval
"""

import casadi as ca
import numpy as np

# Lobatto IIIA (Hairer & Wanner II, table 5.7) and forward Euler: abscissae, weights of unknown nodes.
SCHEMES = {
    "euler": ([0, 1], [[1, 0]]),
    "trapezoid": ([0, 1], [[1 / 2, 1 / 2]]),
    "hermite-simpson": ([0, 1 / 2, 1], [[5 / 24, 1 / 3, -1 / 24], [1 / 6, 2 / 3, 1 / 6]]),
}
STATES, PARAMETERS = 9, 6
POSITION = 3  # among the states: those of the pilot come first
# Which of the states are known at the first sample: the position is measured there, and estimated.
REST = list(range(POSITION + 1, STATES))
INITIAL_STATES = {"free": [], "vehicle-at-rest": REST, "at-rest": [*range(POSITION), *REST]}
MARGIN = 1e-6  # every pole of the pilot is further left [1/s]
LOOP_MARGIN = 1e-3  # every pole of the closed loop is further left [1/s]
STICK_LIMIT = 1.0
CLEARANCE = 1e-7  # least scaled value of the stability conditions
MULTIPLIER_SCALE = 100.0  # s_max of Wächter & Biegler


def joint():
    """Closed loop of the quadcopter's pitch axis and a third-order pilot: x' = f(x, target, theta)."""
    x, target = ca.SX.sym("x", STATES), ca.SX.sym("target")
    theta = ca.SX.sym("theta", PARAMETERS)
    pilot = x[:POSITION]
    z, phi, v, q, front, back = ca.vertsplit(x[POSITION:])
    mass, arm, inertia, gravity, hover = 1.2, 0.225, 0.0123, 9.80665, 0.9214
    lag, gain, k_phi, k_q, full = 14.48, 0.0222, 22.96, 10.76, ca.pi / 4
    stick = ca.dot(theta[3:], pilot)
    thrust = lambda omega: mass * gravity / 4 * (1 + omega / hover) ** 2
    throttle = k_phi * (full * stick - phi) - k_q * q
    rate = ca.vertcat(
        pilot[1],
        pilot[2],
        target - z - ca.dot(theta[:3], pilot),
        v,
        q,
        -2 / mass * (thrust(front) + thrust(back)) * ca.sin(phi),
        ca.sqrt(2) * arm / inertia * (thrust(front) - thrust(back)),
        -lag * front + gain * throttle,
        -lag * back - gain * throttle,
    )
    return ca.Function("f", [x, target, theta], [rate]), ca.Function("u", [x, theta], [stick])


def product(a, b):
    """Two polynomials, highest power first."""
    out = [0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def routh(polynomial, margin):
    """First column of Routh's array, without its first entry, of a polynomial in s - margin."""
    shifted = [0]
    for coefficient in polynomial:
        shifted = product(shifted, [1, -margin])
        shifted[-1] += coefficient
    shifted = shifted[-len(polynomial) :]
    upper, lower, column = shifted[::2], shifted[1::2], []
    while lower:
        column.append(lower[0])
        padded = lower + [0] * (len(upper) - len(lower))
        rest = [u - upper[0] / lower[0] * l for u, l in zip(upper[1:], padded[1:])]
        upper, lower = lower, rest
    return column


def closed_loop(theta):
    """The characteristic polynomial of the closed loop about hover. The sum of the rotor speeds, which nothing excites,
    is the factor s + lag."""
    mass, arm, inertia, gravity, hover = 1.2, 0.225, 0.0123, 9.80665, 0.9214
    lag, gain, k_phi, k_q, full = 14.48, 0.0222, 22.96, 10.76, np.pi / 4
    beta = np.sqrt(2) * arm / inertia * mass * gravity / hover * gain
    vehicle = product([1, 0, 0], [1, lag, beta * k_q, beta * k_phi])
    characteristic = product([1, theta[2], theta[1], theta[0]], vehicle)
    for i, numerator in enumerate([theta[5], theta[4], theta[3]]):
        characteristic[len(characteristic) - 3 + i] -= gravity * full * beta * k_phi * numerator
    return product([1, lag], characteristic)


def stability(theta):
    """Routh's columns of the pilot and of its closed loop: all positive."""
    pilot = routh([1, theta[2], theta[1], theta[0]], MARGIN)
    return ca.vertcat(*pilot, *routh(closed_loop(theta), LOOP_MARGIN))


class Problem:
    """The scaled NLP: `nlp` and `limits` for CasADi's nlpsol, and `gauss_newton`, the diagonal of the
    objective's Hessian, which is the Gauss-Newton matrix since the residuals are linear."""

    def __init__(self, scheme, initial_state, trials, scale, scale_theta, stick_size=1.0):
        self.abscissae, self.weights = SCHEMES[scheme]
        self.known = INITIAL_STATES[initial_state]
        self.f, self.stick = joint()
        self.scale, self.scale_theta = np.array(scale), np.array(scale_theta)
        self.stick_size = stick_size
        theta_bar = ca.MX.sym("theta", PARAMETERS)
        self.theta = theta_bar * self.scale_theta
        runs = [self.run(j, trial) for j, trial in enumerate(trials)]
        x, objective, defects, sticks, lower, upper, curvature = zip(*runs)
        # As pilotage does, the stability conditions are divided by their size at theta's scales.
        size = np.maximum(np.abs(np.array(ca.DM(stability(ca.DM(self.scale_theta)))).ravel()), 1e-3)
        equal, bounded = ca.vertcat(*defects), ca.vertcat(*sticks)
        self.defects = [defect.numel() for defect in defects]
        self.nlp = {
            "x": ca.vertcat(*map(ca.vec, x), theta_bar),
            "f": sum(objective),
            "g": ca.vertcat(equal, bounded, stability(self.theta) / size),
        }
        zero, limit = np.zeros(equal.numel()), np.full(bounded.numel(), STICK_LIMIT / stick_size)
        free = np.full(PARAMETERS, np.inf)
        conditions = stability(self.theta).numel()
        self.limits = {
            "lbx": np.concatenate([*lower, -free]),
            "ubx": np.concatenate([*upper, free]),
            "lbg": np.concatenate([zero, -limit, np.full(conditions, CLEARANCE)]),
            "ubg": np.concatenate([zero, limit, np.full(conditions, np.inf)]),
        }
        self.gauss_newton = np.concatenate([*curvature, np.zeros(PARAMETERS)])

    def run(self, j, trial):
        """Unknowns, squares, defects, sticks, limits of the unknowns and objective's curvature."""
        s, n = len(self.weights), len(trial.time) - 1
        x = ca.MX.sym(f"x{j}", STATES, 1 + s * n)
        physical = ca.diag(self.scale) @ x
        theta, h = self.theta, np.diff(trial.time)
        at = [c * trial.target[1:] + (1 - c) * trial.target[:-1] for c in self.abscissae]
        nodes = [physical[:, i : i + s * (n - 1) + 1 : s] for i in range(s + 1)]
        rates = [
            self.f.map(n)(node, ca.DM(target).T, ca.repmat(theta, 1, n))
            for node, target in zip(nodes, at)
        ]
        defects = []
        for i, row in enumerate(self.weights):
            change = sum(a * rate for a, rate in zip(row, rates) if a != 0)
            defect = nodes[i + 1] - nodes[0] - change * ca.repmat(ca.DM(h).T, STATES, 1)
            defects.append(ca.diag(1 / self.scale) @ defect)
        boundary = physical[:, ::s]
        stick = self.stick.map(n + 1)(boundary, ca.repmat(theta, 1, n + 1))
        seen = np.isfinite(trial.position)
        recorded = ca.DM(np.where(seen, trial.position, 0)).T
        mask = ca.DM(seen.astype(float)).T
        squares = trial.weight * ca.sumsqr(mask * (recorded - boundary[POSITION, :]))
        # Hover somewhere, the pilot at zero.
        lower = np.full(x.numel(), -np.inf)
        upper = np.full(x.numel(), np.inf)
        lower[self.known] = upper[self.known] = 0
        curvature = np.zeros(x.numel())
        curvature[POSITION :: STATES * s] = 2 * trial.weight * seen * self.scale[POSITION] ** 2
        return x, squares, ca.vec(ca.vertcat(*defects)), stick.T / self.stick_size, lower, upper, curvature

    def multipliers(self, equality, inequality):
        """CasADi's multipliers of g and of z from those of pilotage, whose equalities begin in each
        run with its known initial states."""
        lam_x, lam_g, rest = np.zeros(self.nlp["x"].numel()), [], np.array(equality)
        fixed = np.flatnonzero(self.limits["lbx"] == self.limits["ubx"])
        known = len(self.known)
        for j, defects in enumerate(self.defects):
            lam_x[fixed[j * known : (j + 1) * known]] = rest[:known]
            lam_g.append(rest[known : known + defects])
            rest = rest[known + defects :]
        return np.concatenate([*lam_g, inequality]), lam_x

    def kkt(self, x, lam_g, lam_x):
        return kkt(self.nlp, self.limits, x, lam_g, lam_x)


def kkt(nlp, limits, x, lam_g, lam_x):
    """Objective, and the KKT residual: stationarity, violation, complementarity, scaled as in
    Wächter & Biegler 2006, eq. 5."""
    x, lam_g, lam_x = (np.array(v).ravel() for v in (x, lam_g, lam_x))
    z, m, p = nlp["x"], ca.MX.sym("m", nlp["g"].numel()), nlp.get("p", ca.MX(0, 1))
    slope = ca.gradient(nlp["f"] + ca.dot(m, nlp["g"]), z)
    values = ca.Function("values", [z, m, p], [nlp["f"], slope, nlp["g"]])
    objective, slope, g = (np.array(v).ravel() for v in values(x, lam_g, limits.get("p", [])))
    lower = np.concatenate([limits["lbg"], limits["lbx"]])
    upper = np.concatenate([limits["ubg"], limits["ubx"]])
    held = np.isfinite(lower) | np.isfinite(upper)
    value, multiplier = np.concatenate([g, x])[held], np.concatenate([lam_g, lam_x])[held]
    lower, upper = lower[held], upper[held]
    violation = np.maximum(lower - value, value - upper)
    inequality = lower < upper
    distance = np.where(multiplier > 0, upper - value, value - lower)[inequality]
    product = np.abs(multiplier[inequality]) * np.where(np.isfinite(distance), distance, 1)
    scale = lambda lam: max(np.abs(lam).sum() / max(lam.size, 1), MULTIPLIER_SCALE) / MULTIPLIER_SCALE
    dual = np.abs(slope + lam_x).max() / scale(multiplier)
    parts = dual, violation.max(), product.max(initial=0.0) / scale(multiplier[inequality])
    return float(objective[0]), [float(part) for part in parts]
