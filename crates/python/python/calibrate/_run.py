"""A run: what a calibration found, in its folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _arviz, _calibrate
from ._errors import mistake
from ._priors import FloatArray, numbers, real, word


class Text(str):
    """Text that a prompt or a notebook shows as it is, not between quotes."""

    def __repr__(self) -> str:
        return str(self)


class Columns(Mapping[str, FloatArray]):
    """A column of numbers for each parameter, all of one length, by its name: SI units, which :attr:`units` tells."""

    def __init__(self, columns: Mapping[str, FloatArray], units: Mapping[str, str]) -> None:
        self._columns = dict(columns)
        #: Unit of each parameter, "1" where it has none.
        self.units = dict(units)

    def __getitem__(self, name: str) -> FloatArray:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"{name!r}; the parameters are {', '.join(self._columns)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def to_array(self) -> FloatArray:
        """All columns as one array of shape (rows, parameters), in the order of the parameters."""
        return np.column_stack(list(self._columns.values()))

    def __repr__(self) -> str:
        rows = len(next(iter(self._columns.values()), np.empty(0)))
        return f"<{rows} rows of {', '.join(f'{name} [{self.units[name]}]' for name in self)}>"


@dataclass(frozen=True)
class Trust:
    """Whether a result can be trusted, by the weights of its samples."""

    #: "converged", "rough" or "untrusted".
    verdict: str
    #: Effective sample size.
    ess: float
    #: Pareto shape of the weights; trustworthy below :attr:`khat_limit`.
    khat: float
    khat_limit: float
    #: Reasons to be careful, each with what helps.
    advice: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether nothing speaks against the sampling."""
        return self.verdict == "converged"

    def __str__(self) -> str:
        head = f"{self.verdict}: {self.ess:.0f} effective samples, k-hat {self.khat:.2f} (limit {self.khat_limit:.2f})"
        return "\n".join([head, *(f"  careful: {line}" for line in self.advice)])


@dataclass(frozen=True)
class Marginal:
    """What is known of one parameter [SI]: posterior mean, sd, median, equal-tailed intervals."""

    mean: float
    sd: float
    median: float
    eti50: tuple[float, float]
    eti95: tuple[float, float]
    unit: str


def _not_negative(place: str, given: Any) -> list[float]:
    array = np.atleast_1d(numbers(place, given))
    if array.ndim != 1 or np.any(array < 0):
        raise mistake(place, repr(given), "numbers of at least 0")
    values: list[float] = array.tolist()
    return values


class Temporary:
    """What keeps a temporary folder: it goes with the last that holds this."""


class Figure:
    """A figure of a run. A notebook shows it; :attr:`png` and :attr:`svg` are its files."""

    def __init__(self, png: Path, owner: Temporary | None = None) -> None:
        self.png, self.svg = png, png.with_suffix(".svg")
        # The files are there as long as the figure is.
        self._owner = owner

    def save(self, path: str | Path) -> Path:
        """Copies it to a file that ends with .png or .svg."""
        path = Path(path)
        source = {".png": self.png, ".svg": self.svg}.get(path.suffix)
        if source is None:
            raise mistake("path", f"{path.name!r}", "a name that ends with .png or .svg")
        shutil.copyfile(source, path)
        return path

    def _repr_png_(self) -> bytes:
        return self.png.read_bytes()

    def __repr__(self) -> str:
        return f"<figure {self.png.stem}>"


class Run:
    """A finished calibration.

    Two sets of parameter vectors are at hand. :attr:`posterior` are draws that count alike, for histograms and for carrying the
    posterior on; they repeat samples of large weight. :attr:`samples` are all simulations with their :attr:`weights`; means and
    intervals of the summary are from these, or after very few simulations of moved ones, as draws then are, which a concern says.
    """

    def __init__(self, path: str | Path) -> None:
        found = _calibrate.read(Path(path))
        self._owner: Temporary | None = None
        #: Folder of the run, with everything that the command writes: tables, figures, ``report.html``.
        self.folder = Path(found["folder"])
        #: Contents of ``posterior.json``.
        self.record: dict[str, Any] = json.loads(found["record"])
        self._summary = str(found["summary"])
        parameters = self.record["plan"]["parameters"]
        #: Names of the parameters, in order.
        self.parameters: list[str] = [parameter["name"] for parameter in parameters]
        units = {parameter["name"]: parameter["unit"] for parameter in parameters}

        def columns(columns: Sequence[bytes]) -> Columns:
            return Columns(dict(zip(self.parameters, map(np.frombuffer, columns))), units)

        #: All simulations [SI], each column of shape (n,); they count by :attr:`weights`.
        self.samples = columns(found["samples"])
        #: Normalised weights of :attr:`samples`, shape (n,).
        self.weights: FloatArray = np.frombuffer(found["weights"])
        #: Equally weighted draws [SI], each column of shape (draws,).
        self.posterior = columns(found["draws"])
        #: Noise standard deviation of each draw [unit of the values], shape (draws,); None where it is not one unknown number.
        self.sigma: FloatArray | None = None if found["sigma"] is None else np.frombuffer(found["sigma"])

    @property
    def name(self) -> str:
        """Name of the run."""
        return str(self.record["plan"]["name"])

    @property
    def trust(self) -> Trust:
        """Whether to trust it."""
        trust = self.record["trust"]
        return Trust(trust["verdict"], trust["effective_samples"], trust["khat"], trust["khat_limit"], tuple(self.record["advice"]))

    @property
    def log_evidence(self) -> float:
        """Natural logarithm of the evidence; the likelihood is a density in the units of the values."""
        return float(self.record["log_evidence"]["value"])

    @property
    def map(self) -> dict[str, float]:
        """The parameters of highest posterior density [SI]."""
        return dict(zip(self.parameters, self.record["map"]["theta"]))

    @property
    def failures(self) -> dict[str, int]:
        """Number of simulations that failed, by cause."""
        return {failure["cause"]: failure["count"] for failure in self.record["failures"]}

    @property
    def simulated(self) -> FloatArray:
        """What a function of yours gave for each of :attr:`samples`, shape (n, m), NaN where it failed."""
        values = _calibrate.simulated(self.folder)
        if values is None:
            raise mistake(str(self.folder), "a run of a built-in simulator or of a program", "one of a Python function, whose values are kept")
        return np.frombuffer(values).reshape(len(self.weights), -1)

    def marginal(self, name: str) -> Marginal:
        """What is known of a parameter."""
        for summary in self.record["parameters"]:
            if summary["parameter"]["name"] == name:
                si = summary["in_si"]
                ends = [(si[key]["lower"], si[key]["upper"]) for key in ("eti50", "eti95")]
                return Marginal(si["mean"], si["sd"], si["median"], ends[0], ends[1], summary["parameter"]["unit"])
        raise KeyError(f"{name!r}; the parameters are {', '.join(self.parameters)}")

    def summary(self) -> Text:
        """The summary of the command, about ten lines."""
        return Text(self._summary.rstrip())

    def predict(
        self,
        contact_ratio: float | Sequence[float] = (),
        *,
        after_s: float | Sequence[float] = (),
        radius_m: float | None = None,
        with_noise: bool = False,
        of: str | None = None,
        heat: str | Path | None = None,
        pulse_energy: float | None = None,
        energy_for: float | None = None,
        probability: float = 0.95,
    ) -> Prediction:
        """When a neck has grown to a contact ratio a/R, and what it is after a time [s], with the intervals of the posterior.

        For runs of pairs of particles; the rest is as the options of ``calibrate predict``.

        Parameters
        ----------
        contact_ratio, after_s : float, or several
            Contact ratios a/R whose times are asked for, and times [s] whose contact ratios are.
        radius_m : float
            Radius of the particles that are predicted [m]; that of the calibration if not given.
        with_noise : bool
            Whether a/R after a time is given as measured, too.
        of : str
            The experiment, of a run of several.
        heat : path
            Another heat: a file with ``[heat]``.
        pulse_energy : float
            Another energy of the pulse.
        energy_for, probability : float
            A contact ratio whose pulse energy is asked for, and the probability with which it is to be enough.
        """
        targets = _not_negative("contact_ratio", contact_ratio)
        times = _not_negative("after_s", after_s)
        given = {"radius_m": radius_m, "pulse_energy": pulse_energy, "energy_for": energy_for, "probability": probability}
        asked: dict[str, Any] = {name: real(name, value) for name, value in given.items() if value is not None}
        asked |= {"with_noise": with_noise} | ({} if of is None else {"of": word("of", of)}) | ({} if heat is None else {"heat": Path(heat)})
        text, found = _calibrate.predict(self.folder, targets, times, asked)
        return Prediction(json.loads(found), text)

    def _figure(self, name: str) -> Figure:
        path = self.folder / f"{name}.png"
        if not path.is_file():
            there = ", ".join(self.figures) or "none"
            raise mistake("figure", repr(name), f"one of this run's: {there}")
        return Figure(path, self._owner)

    @property
    def figures(self) -> list[str]:
        """Names of the figures of the run, for :meth:`plot`."""
        return sorted(path.stem for path in self.folder.glob("*.png"))

    def plot(self, name: str) -> Figure:
        """A figure by its name, one of :attr:`figures`."""
        return self._figure(name)

    def plot_corner(self) -> Figure:
        """Marginals and pair densities of the parameters."""
        return self._figure("corner")

    def plot_fit(self) -> Figure:
        """Measurements, and the bands of the posterior; the first where several quantities were measured."""
        return self._figure(next((name for name in self.figures if name.startswith("fit")), "fit"))

    def plot_residuals(self) -> Figure:
        """Measured minus best curve; the first where several quantities were measured."""
        return self._figure(next((name for name in self.figures if name.startswith("residuals")), "residuals"))

    def plot_recursion(self) -> Figure:
        """What was known after each observation."""
        return self._figure("recursion")

    def plot_convergence(self) -> Figure:
        """How the sampler got there, stage by stage."""
        return self._figure("convergence")

    def to_arviz(self) -> Any:
        """The run for ArviZ: a ``DataTree`` from ArviZ 1.0 on, ``InferenceData`` before. Needs arviz.

        Groups posterior, prior, log_likelihood, posterior_predictive, observed_data, sample_stats. Its draws count alike, and
        there are no more of them than the effective sample size; what there is of importance sampling (effective samples,
        k-hat, evidence) are attributes.
        """
        return _arviz.to_arviz(self.folder)

    def to_datatree(self) -> Any:
        """The same groups as a ``DataTree``. Needs xarray."""
        return _arviz.to_datatree(self.folder)

    def export(self, format: str, out: str | Path) -> Path:
        """Writes them into the folder ``out`` as ``calibrate export`` does: "zarr", "idata-json", "stan-csv" or "draws-csv"."""
        return _calibrate.export(self.folder, format, Path(out))

    def to_netcdf(self, path: str | Path) -> Path:
        """Writes the same groups as NetCDF, which ``xarray.open_datatree`` and ``arviz.from_netcdf`` read. Needs xarray and netCDF4."""
        return _arviz.to_netcdf(self.folder, path)

    def save(self, path: str | Path) -> Path:
        """Copies the folder of the run to ``path``, which must not be there yet; the command reads it."""
        path = Path(path)
        if path.exists():
            raise mistake(str(path), "a file or folder that is there", "a new name")
        aside = path.with_name(f".{path.name}.part")
        shutil.copytree(self.folder, aside)
        aside.rename(path)
        return path

    def _repr_png_(self) -> bytes:
        return self.plot_corner()._repr_png_()

    def __repr__(self) -> str:
        return f"<run {self.name}: {', '.join(self.parameters)}; {self.trust.verdict}>"


class Prediction(dict[str, Any]):
    """A prediction as the record of ``calibrate predict --json``; a prompt shows it in words."""

    def __init__(self, found: dict[str, Any], text: str) -> None:
        super().__init__(found)
        self._text = text.rstrip()

    def __repr__(self) -> str:
        return self._text

    __str__ = __repr__


def read(path: str | Path) -> Run:
    """Reads a run by its folder, or by its ``posterior.json``, whoever made it."""
    return Run(path)
