#!/usr/bin/env python3
"""Writes reduced_times.csv: integrals of mobilities over histories, by exponential integrals, to 50 digits.

    python3 reduced_times.py > reduced_times.csv        (needs mpmath)

All laws are ln m = B/(T_ref - T0) - B/(T - T0): Arrhenius with B = Ea/Rg, T0 = 0; WLF with B = c1 c2 ln 10, T0 = T_ref - c2. With y = T - T0, a pulse has
dt = -t_cool dy/(y - y_amb) and a ramp dt = dy/rate, so that s is a difference of exponential integrals Ei.
Inputs are the doubles that the test reads, taken exactly.
"""
from mpmath import mp, mpf, exp, log, ei, inf

mp.dps = 50
RG = mpf(8.31446261815324)


def vogel(kind, first, second, reference):
    if kind == "arrhenius":
        return mpf(first) / RG, mpf(0)
    return mpf(first) * log(10) * mpf(second), mpf(reference) - mpf(second)


def ramp(b, at_reference, y0, y1, rate):
    """Integral of exp(at_reference - b/y) dy / rate: y exp(-b/y) + b Ei(-b/y)."""
    part = lambda y: y * exp(-b / y) + b * ei(-b / y) if y > 0 else mpf(0)
    return exp(at_reference) * (part(y1) - part(y0)) / rate


def pulse(b, at_reference, ambient, y0, y1, cooling):
    """With z = 1/y: t_cool times the integral of exp(at_reference - b z) (1/z + y_amb/(1 - y_amb z)) dz."""
    z0, z1 = 1 / y0, 1 / y1
    first = ei(-b * z1) - ei(-b * z0)
    if ambient == 0:
        return exp(at_reference) * first * cooling
    q = 1 / ambient  # 1/z pole: y_amb/(1 - y_amb z) = 1/(q - z)
    second = exp(-b * q) * (ei(b * (q - z0)) - ei(b * (q - z1)))
    return exp(at_reference) * (first + second) * cooling


LAWS = [
    ("arrhenius", 100e3, 0.0, 450.0),
    ("arrhenius", 20e3, 0.0, 600.0),
    ("arrhenius", 900e3, 0.0, 500.0),
    ("wlf", 13.7, 50.0, 373.0),
    ("wlf", 17.44, 51.6, 420.0),
    ("wlf", 5.0, 120.0, 373.0),
]
# ambient, rise, cooling time, floor (0: none)
PULSES = [(300.0, 200.0, 0.5, 0.0), (300.0, 200.0, 0.5, 373.0), (330.0, 150.0, 2e-3, 0.0), (400.0, 900.0, 30.0, 410.0)]
print("law,first,second,reference,history,low,high,scale,floor,time,s")


def row(law, history, low, high, scale, floor, time, s):
    print(*law[:1], *law[1:], history, low, high, scale, floor, time, mp.nstr(s, 20), sep=",")


for law in LAWS:
    b, t0 = vogel(*law)
    at_reference = b / (mpf(law[3]) - t0)
    for ambient, rise, cooling, floor in PULSES:
        for share in [1e-6, 0.01, 0.3, 1.0, 2.5, 8.0, 50.0]:
            time = share * cooling
            y0 = mpf(ambient) + mpf(rise) - t0
            y1 = max(mpf(ambient) + mpf(rise) * exp(-mpf(time) / mpf(cooling)), mpf(floor)) - t0
            if y0 <= 0:
                continue
            if y1 <= 0:
                continue  # past the Vogel temperature: the row of the last time before it has the integral
            s = pulse(b, at_reference, mpf(ambient) - t0, y0, y1, mpf(cooling))
            if s > mpf("1e-280"):
                row(law, "pulse", ambient, rise, cooling, floor, time, s)
    for low, high, rate in [(300.0, 500.0, 10.0), (350.0, 450.0, 0.02)]:
        for share in [0.05, 0.6, 0.9, 1.0]:
            time = share * (high - low) / rate
            top = mpf(low) + mpf(rate) * mpf(time)
            y0, y1 = max(mpf(low) - t0, mpf(0)), top - t0
            if y1 <= 0:
                continue
            s = ramp(b, at_reference, y0, y1, mpf(rate))
            if s > mpf("1e-280"):
                row(law, "ramp", low, high, rate, 0.0, time, s)
