"""A program as a user writes it, for mypy alone: what the module says of its types holds."""

import numpy as np

import calibrate as cal


def spring(k: float, mu: float) -> list[float]:
    """A spring."""
    return [k * mu, k + mu]


run: cal.Run = cal.calibrate(
    simulator=spring,
    parameters={"k": cal.LogUniform(1e2, 1e6, unit="N/m"), "mu": cal.Uniform(0, 1)},
    observations=cal.Observations([0.0, 1.0], np.array([1.0, 2.0]), noise=cal.Inferred(s0=0.05)),
    samples=300,
    seed=1,
)
k: float = float(run.posterior["k"].mean())
verdict: str = run.trust.verdict
times: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = cal.neck_growth([0.0, 1.0], c1=1e-4, tau_s=2.0, delta_c=1e-7, powder=cal.PEEK)
