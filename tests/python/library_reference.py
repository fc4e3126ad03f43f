"""Poles, static gains and frequency responses of the built-in models, from transfer functions written by hand.

Prints the table that is committed as tests/it/model_library.txt. Each transfer function is taken from the source
that the model names, or derived on paper; no model file is read. Every model stands with its start values, which
are written here once more (`-` in the table), and with other values for each of its parameters.

    python3 tests/python/library_reference.py > tests/it/model_library.txt
"""

import numpy as np

S = np.poly1d([1.0, 0.0])
ONE = np.poly1d([1.0])
FREQUENCIES = [0.3, 2.0, 9.0]

# Numerators of Padé's approximants of e^-x at x = 0, powers from 0 up (Golub & Van Loan, Matrix Computations, 4th
# edition, section 9.3.1, gives the law; these are the numbers). The denominator has the same without signs.
PADE = {
    1: [2, -1],
    2: [12, -6, 1],
    3: [120, -60, 12, -1],
    4: [1680, -840, 180, -20, 1],
    5: [30240, -15120, 3360, -420, 30, -1],
}


def delay(tau, order):
    """Numerator and denominator of the approximant in s."""
    number = [c * tau**k for k, c in enumerate(PADE[order])]
    return np.poly1d(number[::-1]), np.poly1d([abs(c) for c in number[::-1]])


def limb(omega, zeta):
    """1 over this is the second-order system of gain 1."""
    return np.poly1d([1 / omega**2, 2 * zeta / omega, 1.0])


def crossover(gain, lag, delay_, order=2):
    n, d = delay(delay_, order)
    return {("target", "stick"): (gain * n, d * (lag * S + 1))}


def tustin(gain, lead, delay_, lag):
    n, d = delay(delay_, 2)
    return {("target", "stick"): (gain * n * (lead * S + 1), d * S * (lag * S + 1))}


def lead_lag(gain, lead, lag, delay_):
    n, d = delay(delay_, 2)
    return {("target", "stick"): (gain * n * (lead * S + 1), d * (lag * S + 1))}


def precision(gain, lead, lag, delay_, muscle_lag, omega_n, zeta_n):
    n, d = delay(delay_, 3)
    muscle = (muscle_lag * S + 1) * limb(omega_n, zeta_n)
    return {("target", "stick"): (gain * n * (lead * S + 1), d * (lag * S + 1) * muscle)}


def extended_crossover(gain, lead, delay_, omega_nm, zeta_nm):
    n, d = delay(delay_, 3)
    return {("target", "stick"): (gain * n * (lead * S + 1), d * limb(omega_nm, zeta_nm))}


def hess(gain, delay_, feeling, feeling_lag, omega_n, zeta_n):
    """Y_n / (1 + Y_n Y_f) behind gain and delay, cleared of fractions."""
    n, d = delay(delay_, 3)
    inner = limb(omega_n, zeta_n) * (feeling_lag * S + 1) + feeling
    return {("target", "stick"): (gain * n * (feeling_lag * S + 1), d * inner)}


def linear(*theta):
    order = len(theta) // 2
    denominator = np.poly1d([1.0, *theta[:order][::-1]])
    return {("target", "stick"): (np.poly1d(theta[order:][::-1]), denominator)}


def crossover2(gain, gain2, lead, lag, delay_):
    """No path from one axis to the other; both have the same poles."""
    first = lead_lag(gain, lead, lag, delay_)[("target", "stick")]
    second = lead_lag(gain2, lead, lag, delay_)[("target", "stick")]
    zero = (np.poly1d([0.0]), ONE)
    return {
        ("target", "stick"): first,
        ("target2", "stick2"): second,
        ("target", "stick2"): zero,
        ("target2", "stick"): zero,
    }


def gain(gain_):
    return {("stick", "position"): (gain_ * ONE, ONE)}


def integrator(gain_):
    return {("stick", "position"): (gain_ * ONE, S)}


def double_integrator(gain_):
    return {("stick", "position"): (gain_ * ONE, S * S), ("stick", "speed"): (gain_ * ONE, S)}


def lag_integrator(gain_, drag):
    return {
        ("stick", "position"): (gain_ * ONE, S * (S + drag)),
        ("stick", "speed"): (gain_ * ONE, S + drag),
    }


def short_period(speed, z_alpha, z_delta, m_alpha, m_q, m_delta, max_elevator):
    """By Cramer's rule from s a = Za a + q + Zd e, s q = Ma a + Mq q + Md e with e = -max_elevator stick."""
    determinant = (S - z_alpha) * (S - m_q) - m_alpha
    alpha = -max_elevator * (z_delta * (S - m_q) + m_delta)
    q = -max_elevator * ((S - z_alpha) * m_delta + m_alpha * z_delta)
    return {
        ("stick", "alpha"): (alpha, determinant),
        ("stick", "q"): (q, determinant),
        ("stick", "theta"): (q, S * determinant),
        # speed (theta - alpha) is the climb; its derivative is the acceleration.
        ("stick", "normal_acceleration"): (speed * (q - S * alpha), determinant),
        ("stick", "position"): (speed * (q - S * alpha), S * S * determinant),
    }


def hover(gravity, max_tilt, omega, zeta, drag):
    """About hover: gravity times tilt accelerates."""
    attitude = limb(omega, zeta)
    each = {}
    for axis in ["", "2"]:
        speed = (gravity * max_tilt * ONE, attitude * (S + drag))
        each[("stick" + axis, "velocity" + axis)] = speed
        each[("stick" + axis, "position" + axis)] = (speed[0], speed[1] * S)
        each[("stick" + axis, "pitch" if axis == "" else "roll")] = (max_tilt * ONE, attitude)
    each[("stick", "position2")] = each[("stick2", "position")] = (np.poly1d([0.0]), ONE)
    return each


def quadcopter(m, l, i, g, w0, a, b, k_phi, k_q, phi_max):
    """About hover, as docs/method.md: s^3 + a s^2 + beta k_q s + beta k_phi is the pitch loop; v' = -g phi."""
    beta = 2**0.5 * l / i * (m * g / w0) * b
    loop = S**3 + a * S**2 + beta * k_q * S + beta * k_phi
    phi = (beta * k_phi * phi_max * ONE, loop)
    return {
        ("stick", "phi"): phi,
        ("stick", "q"): (phi[0] * S, loop),
        ("stick", "v"): (-g * phi[0], loop * S),
        ("stick", "z"): (-g * phi[0], loop * S * S),
    }


# Poles that no transfer function above shows: of the rotors' sum, which the torque does not move.
HIDDEN = {"quadcopter": lambda values: [-values["propeller_lag"]]}
# How often a transfer function's poles stand in the model: two axes, two equal sets.
COPIES = {"crossover2": 2, "hover": 2}

MODELS = {
    "tustin": (tustin, "gain lead delay lag", [1, 0.3, 0.2, 0.1], [-0.7, 2.2, 0.31, 0.17]),
    "crossover": (crossover, "gain lag delay", [0.1, 0.1, 0.3], [-0.23, 0.27, 0.41]),
    "lead_lag": (lead_lag, "gain lead lag delay", [0.03, 2.5, 0.1, 0.2], [0.19, 0.4, 3.3, 0.37]),
    "precision": (
        precision,
        "gain lead lag delay muscle_lag omega_n zeta_n",
        [0.03, 2.5, 0.1, 0.1, 0.1, 20, 0.7],
        [-0.11, 0.6, 1.7, 0.23, 0.06, 14, 0.21],
    ),
    "extended_crossover": (
        extended_crossover,
        "gain lead delay omega_nm zeta_nm",
        [0.03, 2.5, 0.2, 11, 0.35],
        [0.24, 0.7, 0.29, 7.5, 0.62],
    ),
    "hess": (
        hess,
        "gain delay feeling feeling_lag omega_n zeta_n",
        [0.3, 0.2, 9, 2.5, 10, 0.707],
        [0.45, 0.15, 2.2, 0.8, 12, 0.6],
    ),
    "linear": (
        linear,
        "theta1 theta2 theta3 theta4 theta5 theta6",
        [216, 108, 18, 21.6, 0, 0],
        # The paper's pilot.
        [0.2454, 1.2477, 1.0164, -0.0005, 0.0052, -0.0575],
    ),
    # Within its limit this is the crossover pilot.
    "rate_limit": (
        lambda gain, rate, lag, delay: crossover(gain, lag, delay),
        "gain rate lag delay",
        [0.1, 3, 0.1, 0.3],
        [0.13, 0.7, 0.12, 0.28],
    ),
    "crossover2": (
        crossover2,
        "gain gain2 lead lag delay",
        [0.05, 0.05, 2, 0.1, 0.25],
        [0.07, -0.04, 1.3, 0.16, 0.33],
    ),
    "gain": (gain, "gain", [1], [2.5]),
    "integrator": (integrator, "gain", [10], [-3]),
    "double_integrator": (double_integrator, "gain", [5], [1.7]),
    "lag_integrator": (lag_integrator, "gain drag", [5, 1], [4.1, 0.35]),
    "short_period": (
        short_period,
        "speed z_alpha z_delta m_alpha m_q m_delta max_elevator",
        # Of the book's row in feet: -17.85 ft/s2 for a radian of elevator, -0.001026 1/(ft.s) by w, 774 ft/s.
        [774 * 0.3048, -0.3151, round(-17.85 / 774, 6), -0.001026 * 774, -0.4285, -1.158, 0.1],
        [176 * 0.3048, -2.02, -0.16, -8.8, -2.98, -11.2, 0.3],
    ),
    "hover": (
        hover,
        "gravity max_tilt omega zeta drag",
        [9.80665, 0.5, 5, 0.8, 0.3],
        [3.7, 0.35, 3.2, 0.55, 0.12],
    ),
    "quadcopter": (
        quadcopter,
        "mass arm_length inertia gravity hover_speed propeller_lag propeller_gain attitude_gain rate_gain max_pitch",
        [1.2, 0.225, 0.0123, 9.80665, 0.9214, 14.48, 0.0222, 22.96, 10.76, float(np.pi / 4)],
        [2.1, 0.31, 0.025, 9.7, 0.7, 11, 0.019, 31, 12, 0.6],
    ),
}


def poles(name, transfers, values):
    longest = max((d for _, d in transfers.values()), key=lambda d: d.order)
    own = list(longest.roots) * COPIES.get(name, 1)
    return own + HIDDEN.get(name, lambda _: [])(values)


def show_poles(name, settings, transfers, values):
    row = f"{name} {settings}"
    for pole in sorted(poles(name, transfers, values), key=lambda s: (round(s.real, 9), s.imag)):
        print(f"pole {row} {pole.real:.15g} {pole.imag:.15g}")


def show(name, settings, transfers):
    row = f"{name} {settings}"
    rests = all(abs(d(0)) > 0 for _, d in transfers.values())
    for (start, end), (n, d) in transfers.items():
        if rests:
            print(f"static {row} {start} {end} {n(0) / d(0):.15g}")
        for w in FREQUENCIES:
            value = n(1j * w) / d(1j * w)
            print(f"response {row} {start} {end} {w} {value.real:.15g} {value.imag:.15g}")


# A vehicle of the library for each pilot; with the start values of both the loop is stable.
LOOPS = [
    ("tustin", "gain"),
    ("crossover", "integrator"),
    ("lead_lag", "double_integrator"),
    ("precision", "double_integrator"),
    ("extended_crossover", "lag_integrator"),
    ("hess", "double_integrator"),
    ("linear", "integrator"),
    ("rate_limit", "integrator"),
    ("crossover2", "hover"),
]


def loops():
    """The rightmost pole of each loop, in one axis."""
    for pilot, vehicle in LOOPS:
        n, d = transfers(pilot)[("target", "stick")]
        m, e = transfers(vehicle)[("stick", "position")]
        rightmost = max((n * m + d * e).roots.real)
        print(f"loop {pilot} {vehicle} {rightmost:.15g}")


def transfers(name):
    """With the start values."""
    transfer, _, start, *_ = MODELS[name]
    return transfer(*map(float, start))


def published():
    """The short period of the 747 by the full longitudinal matrix of Etkin & Reid (feet, seconds, radians)."""
    full = np.array(
        [
            [-0.006868, 0.01395, 0.0, -32.2],
            [-0.09055, -0.3151, 773.98, 0.0],
            [0.0001187, -0.001026, -0.4285, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )
    mode = max(np.linalg.eigvals(full), key=lambda s: s.imag)
    print(f"published short_period - {mode.real:.15g} {mode.imag:.15g}")


def approximants():
    """e^-x at x = j, by the coefficients."""
    for order in PADE:
        n, d = delay(1.0, order)
        value = n(1j) / d(1j)
        print(f"pade {order} - {value.real:.15g} {value.imag:.15g}")


def main():
    print("# Printed by tests/python/library_reference.py, which says what the rows are.")
    for name, (transfer, names, *cases) in MODELS.items():
        for case, numbers in enumerate(cases):
            values = dict(zip(names.split(), map(float, numbers)))
            settings = ",".join(f"{key}={value!r}" for key, value in values.items())
            transfers = transfer(*values.values())
            show(name, "-" if case == 0 else settings, transfers)
            # Those of the linear pilot's start values are all equal, which no computation of roots finds well.
            if case == 1:
                show_poles(name, settings, transfers, values)
    loops()
    published()
    approximants()


main()
