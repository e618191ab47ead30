"""Bayesian calibration of sintering DEM, and of simulators of your own.

    import calibrate as cal

    run = cal.calibrate(simulator=f, parameters={"k": cal.LogUniform(1e2, 1e6)}, observations=cal.Observations(u, force, noise=cal.Inferred(s0=0.05)))
    run.summary()
"""

from ._calibrate import __version__ as __version__
from ._calibration import PA12, PEEK, PS, Experiment, Material, Powder, calibrate, experiment, init, material, neck_growth
from ._errors import InputMistake, RunFailed, SimulatorMistake
from ._priors import (
    Correlated,
    EssTarget,
    Fixed,
    Inferred,
    LogNormal,
    LogUniform,
    Noise,
    Normal,
    Observations,
    Prior,
    Relative,
    Robust,
    TruncatedNormal,
    Uniform,
)
from ._progress import CalibrationWarning
from ._run import Columns, Figure, Marginal, Prediction, Run, Trust, read
from ._simulators import StoredRuns

__all__ = [
    "PA12", "PEEK", "PS", "CalibrationWarning", "Columns", "Correlated", "EssTarget", "Experiment", "Figure", "Fixed", "Inferred",
    "InputMistake", "LogNormal", "LogUniform", "Marginal", "Material", "Noise", "Normal", "Observations", "Powder", "Prediction",
    "Prior", "Relative", "Robust", "Run", "RunFailed", "SimulatorMistake", "StoredRuns", "TruncatedNormal", "Trust", "Uniform",
    "calibrate", "experiment", "init", "material", "neck_growth", "read",
]
