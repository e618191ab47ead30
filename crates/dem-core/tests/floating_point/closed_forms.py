#!/usr/bin/env python3
"""Writes closed_forms.csv: the exact solutions to 100 digits, near their singular points.

    python3 closed_forms.py > closed_forms.csv        (needs mpmath)

Inputs are the doubles that the test reads, taken exactly; a/R is rounded to 25 digits. PA12 of Table 1.
"""
from mpmath import mp, mpf, pi, sqrt, cbrt, findroot, log, atan, cos, sin, acos

mp.dps = 100
R, E, GAMMA, ALPHA = mpf(31.5e-6), mpf(1.65e9), mpf(40.70e-3), mpf(1.0e-3)


def start():
    a0 = cbrt(9 * pi * (1 / (2 * E)) * (2 * GAMMA) / (2 * R))
    return max(ALPHA, a0 ** 2)


def constants(c1, delta_c):
    b = 63 * pi ** 3 / 16 * (delta_c / R) ** 2 * (2 * c1 * GAMMA / R)
    knee = ((63 * pi ** 3) ** (mpf(1) / 5) * (delta_c / (8 * R)) ** (mpf(2) / 5)) ** 2
    return b, knee


def pokluda(x_from, tau, t, end):
    """x after a time t, by the angle: t/tau = integral of the published rate, in closed form of w."""
    def w_of(x):
        return findroot(lambda w: 4 * w - 1 / w ** 2 - 3 * x / mpf(4) ** (mpf(1) / 3), (mpf("0.6"), mpf("0.99")),
                        solver="anderson", tol=mpf(10) ** -180, maxsteps=300)

    def big_f(l):
        """F in l = -log(1 - w), where it is nearly a straight line."""
        w = 1 - mp.e ** (-l)
        return l + log(1 + w + w * w) / 2 - sqrt(mpf(3)) * atan((2 * w + 1) / sqrt(mpf(3)))

    if x_from >= mpf(4) ** (mpf(1) / 3):
        return min(x_from, end)
    target = big_f(-log(1 - w_of(x_from))) + t / tau / mpf(2) ** (mpf(4) / 3)
    l = target + mpf("1.5")
    for _ in range(400):
        w = 1 - mp.e ** (-l)
        change = (big_f(l) - target) / (3 * w / (1 + w + w * w))
        l -= change
        if abs(change) < mpf(10) ** -90 * abs(l):
            break
    w = 1 - mp.e ** (-l)
    return min((mpf(4) ** (mpf(1) / 3) / 3) * (4 * w - 1 / w ** 2), end)


def ratio(kinetics, phi, c1, tau, delta_c, t):
    phi, c1, tau, delta_c, t = map(mpf, (phi, c1, tau, delta_c, t))
    x0, end = start(), phi ** 2
    b, knee = constants(c1, delta_c)
    power = mpf(7) / 2
    if kinetics == "frenkel":
        return sqrt(min(x0 + t / tau, end))
    if kinetics == "pokluda":
        return sqrt(pokluda(x0, tau, t, end))
    if kinetics == "regime-map":
        return sqrt(min(max(x0, (b * t) ** (1 / power), t / tau), end))
    knee = min(max(knee, x0), end)
    t_knee = (knee ** power - x0 ** power) / b
    if t <= t_knee:
        return sqrt((x0 ** power + b * t) ** (1 / power))
    if kinetics == "three-stage":
        return sqrt(min(knee + (t - t_knee) / tau, end))
    return sqrt(pokluda(knee, tau, t - t_knee, end))


def knee_delta(x):
    """delta_c with its knee at the overlap x."""
    return float(8 * R * (sqrt(mpf(x)) / (63 * pi ** 3) ** (mpf(1) / 5)) ** (mpf(5) / 2))


def main():
    phi = 2 ** (1 / 3)
    print("kinetics,phi,c1,tau_s,delta_c,time_s,contact_ratio")
    rows = []
    all_five = ["three-stage", "frenkel", "pokluda", "three-stage-pokluda", "regime-map"]
    base = dict(c1=2.4e-5, tau=3.81, delta_c=9.5e-8)
    for kinetics in all_five:
        # x to x0, and on to the end.
        for t in [0.0, 1e-300, 1e-20, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.3, 0.32, 1.0, 3.0, 6.0, 20.0, 100.0]:
            rows.append((kinetics, phi, base["c1"], base["tau"], base["delta_c"], t))
        # B to 0 and to infinity, tau_s to infinity and to 0.
        for c1 in [1e-40, 1e-20, 1e-10, 1e5, 1e20]:
            for t in [1e-6, 1.0, 5.0]:
                rows.append((kinetics, phi, c1, base["tau"], base["delta_c"], t))
        for tau in [1e-9, 1e-3, 1e6, 1e20, 1e40]:
            for share in [1e-12, 1e-3, 0.5, 1.2]:
                # Fast zipping, so that the time since the knee is known to as many digits as the time.
                rows.append((kinetics, phi, 1e12 / tau, tau, base["delta_c"], share * tau))
    # A knee at the start, a rounding above and below, and at the end.
    x0 = float(start())
    for factor in [1 - 1e-12, 1 - 1e-15, 1.0, 1 + 1e-15, 1 + 1e-12, 1 + 1e-6, 1.1]:
        for kinetics in ["three-stage", "three-stage-pokluda"]:
            for t in [1e-9, 1e-3, 0.1, 2.0]:
                rows.append((kinetics, phi, base["c1"], base["tau"], knee_delta(x0 * factor), t))
                rows.append((kinetics, phi, base["c1"], base["tau"], knee_delta(phi * phi * factor), t * 1e3))
    # Other ends.
    for end in [0.15, 0.4, 1.08, 1.259, 1.5]:
        for kinetics in all_five:
            for t in [1e-3, 1.0, 4.0, 50.0]:
                rows.append((kinetics, end, base["c1"], base["tau"], base["delta_c"], t))
    for row in rows:
        print(",".join([row[0]] + [repr(v) for v in row[1:]] + [mp.nstr(ratio(*row), 25)]))


main()
