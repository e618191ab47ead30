"""Calibrations: of a function, of a material, of an experiment of one's own."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _calibrate
from ._errors import RunFailed, mistake
from ._priors import ArrayLike, FloatArray, Noise, Observations, Prior, numbers, real, row, word
from ._progress import Progress
from ._run import Run, Temporary, Text
from ._simulators import Processes, Simulator, StoredRuns, name_of


def calibrate(
    simulator: Any,
    parameters: Mapping[str, Prior],
    observations: Observations | Mapping[str, Observations],
    *,
    samples: int | None = None,
    seed: int = 1,
    vectorized: bool = False,
    processes: int | None = None,
    design: Mapping[str, ArrayLike] | None = None,
    name: str | None = None,
    title: str | None = None,
    out: str | os.PathLike[str] | None = None,
    iterations: int | None = None,
    ess: float | None = None,
    batch: int | None = None,
    max_failed_share: float | None = None,
    threads: int | None = None,
    progress: bool | None = None,
) -> Run:
    """Calibrates a simulator: the posterior of its parameters, given what was measured.

    Parameters
    ----------
    simulator : callable or StoredRuns
        ``f(k=.., mu=..)`` with the parameters by name, or ``f(given)`` with one mapping of them. It returns the values at the x
        of the observations, an array of shape (m,); for several observations one such array for each by name, or all of them
        one after the other. An exception is a failed simulation: it is counted by its cause, and the sample gets no weight.
    parameters : mapping of name to prior
        The parameters in SI, as in ``{"k": LogUniform(1e2, 1e6, unit="N/m")}``.
    observations : Observations, or a mapping of name to Observations
        What was measured.
    samples : int
        Number of simulations, 300 if not given.
    seed : int
        Seed of all random numbers. The same seed gives the same bits, for any number of threads and processes.
    vectorized : bool
        Whether the simulator takes batches: each parameter is an array of shape (n,), and it returns shape (n, m).
    processes : int
        Number of processes that simulate at a time. The function then runs in these: what it changes stays there.
    design : mapping of name to array of shape (n,)
        Parameter sets that are simulated instead of drawn ones.
    name, title : str
        Name of the run, and heading of its tables.
    out : path
        Folder of the results, as the command writes it; a temporary one that goes with the run if not given.
    iterations, ess, batch, max_failed_share :
        Settings of the sampler, as in a plan file: number of stages, effective sample size to stop at, number of simulations
        that sizes of stages are multiples of, share of failures above which it stops.
    threads : int
        Threads of the sampler; all cores if not given.
    progress : bool
        Whether to show a progress bar; by default in a terminal and in a notebook.

    Raises
    ------
    InputMistake (a ValueError)
        For what cannot be calibrated; SimulatorMistake for values of the wrong shape.
    RunFailed (a RuntimeError)
        Where too many simulations fail, or none has a likelihood.
    """
    named = _named(observations)
    if not isinstance(parameters, Mapping) or not parameters:
        raise mistake("parameters", repr(parameters), 'a mapping of names to priors, as {"k": LogUniform(1e2, 1e6)}')
    for parameter, prior in parameters.items():
        word("names of parameters", parameter)
        if not isinstance(prior, Prior):
            raise mistake(f"parameters {parameter}", repr(prior), "a prior", f'{{"{parameter}": Uniform(LOWER, UPPER)}}')
    if isinstance(simulator, StoredRuns):
        if design is not None:
            raise mistake("design", "parameter sets beside stored runs", "one of the two: stored runs have their own")
        design = simulator.parameters
    elif not callable(simulator):
        raise mistake("simulator", repr(simulator), "a function of the parameters, or StoredRuns")
    processes = _whole("processes", processes)
    if seed is None:
        raise mistake("seed", "None", "a whole number: the same seed gives the same bits")
    if processes is not None and (vectorized or processes < 1):
        found = f"{processes} beside vectorized=True" if vectorized else str(processes)
        raise mistake("processes", found, "a number of at least 1, of a function that takes one parameter set")
    widths = {name: len(one) for name, one in named.items()}
    if isinstance(simulator, StoredRuns) and simulator.outputs.shape[1] != sum(widths.values()):
        raise mistake("StoredRuns outputs", f"{simulator.outputs.shape[1]} columns", f"{sum(widths.values())}, one for each observation")
    function = name_of(simulator)
    plan = {
        "name": function.strip("_") or "function" if name is None else word("name", name),
        "title": None if title is None else word("title", title),
        "function": function,
        "parameters": [{"name": key, "unit": word(f"unit of {key}", prior.unit), "prior": prior._spec()} for key, prior in parameters.items()],
        "observables": [one._spec(key) for key, one in named.items()],
        "samples": _whole("samples", samples),
        "iterations": _whole("iterations", iterations),
        "ess": None if ess is None else real("ess", ess, 0.0),
        "seed": _whole("seed", seed),
        "batch": _whole("batch", batch),
        "max_failed_share": None if max_failed_share is None else real("max_failed_share", max_failed_share),
        "design": None if design is None else _design(design, list(parameters)),
    }
    shown = Progress(progress)
    called = Simulator(simulator, list(parameters), widths, shown)
    called.vectorized = vectorized
    if processes is not None and called.called is not None:
        called.processes = Processes(called.called, processes)
    finished = False
    try:
        run = _in_folder(out, plan["name"], shown, lambda folder: _calibrate.calibrate_function(json.dumps(plan), (folder, _whole("threads", threads, 1)), called, shown))
        finished = True
        return run
    except RunFailed as error:
        raise _with_failures(error, called) from called.first_error
    finally:
        shown.close()
        if called.processes is not None:
            called.processes.close(wait_for_it=finished)


def _with_failures(error: RunFailed, called: Simulator) -> RunFailed:
    if not called.first_failures:
        return error
    lines = [f"  first of its kind: {text}" for text in list(called.first_failures.values())[:5]]
    return RunFailed("\n".join([str(error), *lines]))


def _in_folder(out: str | os.PathLike[str] | None, name: Any, shown: Progress, work: Any) -> Run:
    if out is not None:
        folder, kept = work(Path(out))
        if kept is not None:
            shown.note(f"the run that was in {out} is now in {kept}")
        return Run(folder)
    temporary = tempfile.mkdtemp(prefix="calibrate-")
    try:
        folder, _ = work(Path(temporary) / str(name))
        run = Run(folder)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    # The folder goes with the last of the run, its copies and its figures.
    run._owner = owner = Temporary()
    weakref.finalize(owner, shutil.rmtree, temporary, ignore_errors=True)
    return run


#: Largest whole number that is passed on.
_LARGEST = 2**63 - 1


def _whole(place: str, value: Any, least: int = 0) -> int | None:
    if value is None:
        return None
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError):
        raise mistake(place, repr(value), "a whole number") from None
    if isinstance(value, (bool, str)) or number != value or not least <= number <= _LARGEST:
        raise mistake(place, repr(value), f"a whole number of at least {least}, below 2^63")
    return number


def _named(observations: Any) -> dict[str, Observations]:
    if isinstance(observations, Observations):
        observations = {observations.name or "y": observations}
    if not isinstance(observations, Mapping) or not observations:
        raise mistake("observations", repr(observations), "Observations(x, y, noise=...), or a mapping of names to such")
    for name, one in observations.items():
        word("names of observations", name)
        if not isinstance(one, Observations):
            raise mistake(f"observations {name}", repr(one), "Observations(x, y, noise=...)")
    return dict(observations)


def _design(design: Any, names: Sequence[str]) -> list[list[float]]:
    if not isinstance(design, Mapping) or set(design) != set(names):
        found = f"the parameters {', '.join(map(str, design))}" if isinstance(design, Mapping) else type(design).__name__
        raise mistake("design", found, f"a mapping of {', '.join(names)} to their values")
    columns = [row(f"design {name}", design[name]) for name in names]
    if len({len(column) for column in columns}) != 1:
        found = ", ".join(f"{len(column)} of {name}" for name, column in zip(names, columns))
        raise mistake("design", found, "as many values of each")
    sets: list[list[float]] = np.column_stack(columns).tolist()
    return sets


@dataclass(frozen=True)
class Powder:
    """Constants of the particles, all SI."""

    #: Particle radius R [m].
    radius_m: float
    #: Young's modulus E [Pa].
    youngs_modulus_pa: float
    #: Surface tension gamma [N/m].
    surface_tension_n_per_m: float
    #: Density rho [kg/m3].
    density_kg_per_m3: float = 1000.0
    #: Final contact ratio phi at which a neck stops growing, unless one is given.
    final_contact_ratio: float = 1.0

    def _constants(self) -> tuple[float, float, float, float]:
        return (
            float(self.radius_m),
            float(self.youngs_modulus_pa),
            float(self.surface_tension_n_per_m),
            float(self.density_kg_per_m3),
        )


def neck_growth(
    t: ArrayLike,
    *,
    c1: float,
    tau_s: float,
    delta_c: float,
    lambda_: float = 0.0,
    powder: Powder | Material,
    final_contact_ratio: float | None = None,
    kinetics: str = "three-stage",
    solver: str = "auto",
    tolerance: float = 1e-4,
) -> FloatArray:
    """Contact ratio a/R of two sintering particles over time.

    Parameters
    ----------
    t : array of shape (n,), or a number
        Times after first contact [s], in any order.
    c1 : float
        Fluidity C1 [1/(Pa s)].
    tau_s : float
        Sintering time tau_s [s].
    delta_c : float
        Cut-off distance delta_c [m].
    lambda_ : float
        Relaxation time lambda of the kinetics ``bellehumeur`` [s].
    powder : Powder or Material
        The particles: PS, PA12, PEEK or one of your own.
    final_contact_ratio : float
        Contact ratio phi at which growth ends; that of the powder if not given.
    kinetics, solver, tolerance :
        As the options of ``calibrate simulate``.

    Returns
    -------
    array of the shape of ``t``: contact ratios a/R [1].
    """
    times = numbers("t", t)
    order = np.argsort(times, axis=None, kind="stable")
    given = {"c1": c1, "tau_s": tau_s, "delta_c": delta_c, "lambda_": lambda_}
    values = [real(name, value) for name, value in given.items()]
    powder = powder.powder if isinstance(powder, Material) else powder
    if not isinstance(powder, Powder):
        raise mistake("powder", repr(powder), "a powder", "powder=calibrate.PS, PA12, PEEK or Powder(radius_m=.., ..)")
    phi = powder.final_contact_ratio if final_contact_ratio is None else real("final_contact_ratio", final_contact_ratio)
    tolerance = real("tolerance", tolerance, 0.0)
    kinetics, solver = word("kinetics", kinetics), word("solver", solver)
    if times.size == 0:
        return np.empty_like(times)
    sorted_times = np.ascontiguousarray(times.ravel()[order])
    found = _calibrate.contact_ratios(
        sorted_times.tobytes(), (values[0], values[1], values[2], values[3]), powder._constants(), phi, (kinetics, solver, tolerance)
    )
    ratios = np.empty(times.size)
    ratios[order] = np.frombuffer(found)
    return ratios.reshape(times.shape)


class Experiment:
    """Neck growth of a pair of particles that the built-in simulator calibrates."""

    def __init__(self, **options: Any) -> None:
        self._options = options

    def calibrate(
        self,
        *,
        samples: int = 16384,
        seed: int = 1,
        kinetics: str = "three-stage",
        noise: Noise | None = None,
        window_s: tuple[float, float] | None = None,
        solver: str = "auto",
        tolerance: float = 1e-4,
        iterations: int | None = None,
        ess: float | None = None,
        other_kinetics: bool = True,
        out: str | os.PathLike[str] | None = None,
        threads: int | None = None,
        progress: bool | None = None,
    ) -> Run:
        """Calibrates it, as the command does with the options of these names; the same seed gives the same bits."""
        options: dict[str, Any] = {
            **self._options,
            "samples": _whole("samples", samples),
            "seed": _whole("seed", seed),
            "kinetics": kinetics,
            "solver": solver,
            "tolerance": real("tolerance", tolerance, 0.0),
        }
        if noise is not None:
            if not isinstance(noise, Noise):
                raise mistake("noise", repr(noise), "a noise model, as Inferred(s0=0.05)")
            options["noise"] = json.dumps(noise._spec())
        if window_s is not None:
            window = numbers("window_s", window_s)
            if window.shape != (2,):
                raise mistake("window_s", repr(window_s), "two times [s], its begin and its end")
            options["window_s"] = (float(window[0]), float(window[1]))
        if iterations is not None:
            options["iterations"] = _whole("iterations", iterations)
        if ess is not None:
            options["ess"] = real("ess", ess, 0.0)
        shown = Progress(progress)
        name = options.get("material") or Path(options["experiment"]).stem
        try:
            return _in_folder(out, name, shown, lambda folder: _calibrate.calibrate_pair(options, (folder, _whole("threads", threads, 1), other_kinetics), shown))
        finally:
            shown.close()


class Material(Experiment):
    """A material of the paper: its powder, its measurements, its priors."""

    def __init__(self, name: str) -> None:
        found = _calibrate.material(name)
        super().__init__(material=name)
        self.name, self.title = name, str(found["title"])
        radius, modulus, tension, density = found["powder"]
        self.powder = Powder(radius, modulus, tension, density, found["final_contact_ratio"])
        #: Measured times [s] and contact ratios a/R, shape (m,) each.
        self.time_s: FloatArray = np.frombuffer(found["time_s"])
        self.contact_ratio: FloatArray = np.frombuffer(found["contact_ratio"])
        #: Parameters of Table 3 of the paper: c1 [1/(Pa s)], tau_s [s], delta_c [m].
        self.table3: dict[str, float] = dict(zip(("c1", "tau_s", "delta_c"), found["table3"]))

    def __repr__(self) -> str:
        return f"<material {self.name}: {self.title}>"


def material(name: str) -> Material:
    """A material of the paper: "ps", "pa12" or "peek"."""
    return Material(name)


def experiment(
    path: str | os.PathLike[str],
    *others: str | os.PathLike[str],
    prior: str | os.PathLike[str] | None = None,
    material: str | None = None,
) -> Experiment:
    """An experiment of your own by its file, as ``--experiment`` and ``--prior`` of the command; :func:`init` writes both.

    Several are experiments of one powder, as ``--experiment`` given several times: they are calibrated together.
    """
    all_of_them: list[Path] = []
    for one in (path, *others):
        if not isinstance(one, (str, os.PathLike)):
            raise mistake("experiment", repr(one), "a file, or the name of a built-in one", 'several one after the other: experiment("a.toml", "b.toml")')
        all_of_them.append(Path(one))
    options: dict[str, Any] = {"experiment": all_of_them[0], "others": all_of_them[1:]}
    if prior is not None:
        options["prior"] = Path(prior)
    if material is not None:
        options["material"] = material
    return Experiment(**options)


def init(
    table: str | os.PathLike[str],
    *,
    radius_m: float,
    material: str | None = None,
    youngs_modulus_pa: float | None = None,
    surface_tension_n_per_m: float | None = None,
    density_kg_per_m3: float | None = None,
    final_contact_ratio: float | None = None,
    overwrite: bool = False,
) -> Text:
    """Writes an experiment and priors beside a table of your own, as ``calibrate init``; what was found, in words.

    For a table ``neck.csv`` these are ``neck.toml`` and ``neck-priors.toml``, for :func:`experiment`.
    """
    constants = (radius_m, youngs_modulus_pa, surface_tension_n_per_m, density_kg_per_m3)
    text, warnings = _calibrate.init(Path(table), material, constants, final_contact_ratio, overwrite)
    return Text("\n".join([text.rstrip(), *(f"careful: {warning}" for warning in warnings)]))


PS = Material("ps").powder
PA12 = Material("pa12").powder
PEEK = Material("peek").powder
