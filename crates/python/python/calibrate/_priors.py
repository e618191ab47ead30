"""Priors, noise models and observations: what a calibration is told."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _calibrate
from ._errors import mistake

FloatArray = npt.NDArray[np.float64]
ArrayLike = Union[Sequence[float], npt.NDArray[Any], float]


def numbers(place: str, given: Any) -> FloatArray:
    """The given numbers as an array of finite doubles; ``place`` names them in an error."""
    if given is None:
        raise mistake(place, "None", "a number")
    try:
        array = doubles(given)
    except (TypeError, ValueError) as error:
        raise mistake(place, f"{_shown(given)}, which is no array of numbers ({error})", "numbers") from None
    if not np.all(np.isfinite(array)):
        at = np.argwhere(~np.isfinite(np.atleast_1d(array)))[0]
        index = ", ".join(str(i) for i in at)
        value = np.atleast_1d(array)[tuple(at)]
        raise mistake(f"{place}[{index}]" if array.ndim else place, value, "a finite number", "leave out what was not measured")
    return array


def doubles(given: Any) -> FloatArray:
    """An array of doubles of real numbers, none of them masked."""
    if np.ma.is_masked(given):
        raise ValueError("values are masked: leave them out, or fill them")
    if np.iscomplexobj(given):
        raise TypeError("complex numbers: give real and imaginary part, or the modulus")
    return np.array(given, dtype=np.float64)


def real(place: str, given: Any, above: float = -np.inf) -> float:
    """One finite number above a bound."""
    array = numbers(place, given)
    if array.ndim != 0 or not array > above:
        raise mistake(place, _shown(given), "a number" if above == -np.inf else f"a number above {above:g}")
    return float(array)


def word(place: str, given: Any) -> str:
    """A text."""
    if not isinstance(given, str):
        raise mistake(place, _shown(given), "a text")
    return given


def row(place: str, given: Any) -> FloatArray:
    """The given numbers as an array of one dimension."""
    array = numbers(place, given)
    if array.ndim != 1:
        raise mistake(place, f"an array of shape {array.shape}", "one dimension", "give each measured quantity as observations of its own")
    return array


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


class Prior:
    """What is known of a parameter before the measurements. Use one of its families."""

    #: SI unit of the parameter, "1" where it has none.
    unit: str

    def _spec(self) -> dict[str, Any]:
        raise NotImplementedError

    def __post_init__(self) -> None:
        spec = self._spec()
        for name, value in spec.items():
            if name != "kind":
                numbers(f"{type(self).__name__} {name}", value)
        _calibrate.check_prior(type(self).__name__, json.dumps(spec))

    @property
    def support(self) -> tuple[float, float]:
        """Smallest and largest value that the prior allows."""
        return _calibrate.check_prior(type(self).__name__, json.dumps(self._spec()))


def _family(kind: str, prior: Prior, names: Sequence[str]) -> dict[str, Any]:
    return {"kind": kind, **{name: _number(getattr(prior, name)) for name in names}}


def _number(value: Any) -> Any:
    try:
        return float(value)
    except (TypeError, ValueError):
        return value


@dataclass(frozen=True)
class Uniform(Prior):
    """Constant density between ``lower`` and ``upper``."""

    lower: float
    upper: float
    unit: str = field(default="1", kw_only=True)

    def _spec(self) -> dict[str, Any]:
        return _family("uniform", self, ("lower", "upper"))


@dataclass(frozen=True)
class LogUniform(Prior):
    """Constant density of the logarithm between ``lower`` and ``upper``, both above 0."""

    lower: float
    upper: float
    unit: str = field(default="1", kw_only=True)

    def _spec(self) -> dict[str, Any]:
        return _family("log-uniform", self, ("lower", "upper"))


@dataclass(frozen=True)
class Normal(Prior):
    """Normal of this mean and standard deviation."""

    mean: float
    sd: float
    unit: str = field(default="1", kw_only=True)

    def _spec(self) -> dict[str, Any]:
        return _family("normal", self, ("mean", "sd"))


@dataclass(frozen=True)
class LogNormal(Prior):
    """``log10`` of the parameter is normal: ``median`` of the parameter, ``sd_log10`` in decades."""

    median: float
    sd_log10: float
    unit: str = field(default="1", kw_only=True)

    def _spec(self) -> dict[str, Any]:
        return _family("log-normal", self, ("median", "sd_log10"))


@dataclass(frozen=True)
class TruncatedNormal(Prior):
    """Normal, conditioned to lie between ``lower`` and ``upper``; mean and sd are those before truncation."""

    mean: float
    sd: float
    lower: float
    upper: float
    unit: str = field(default="1", kw_only=True)

    def _spec(self) -> dict[str, Any]:
        return _family("truncated-normal", self, ("mean", "sd", "lower", "upper"))


class Noise:
    """How measurements scatter about the simulated values. Use one of its kinds."""

    def _spec(self) -> dict[str, Any]:
        raise NotImplementedError


@dataclass(frozen=True)
class Inferred(Noise):
    """Independent normal errors of one unknown standard deviation sigma, which is integrated out.

    ``s0`` is about the sigma that is expected [unit of the values], ``nu0`` how sure that is, in degrees of freedom.
    """

    s0: float
    nu0: float = 4.0

    def _spec(self) -> dict[str, Any]:
        return {"kind": "inferred", "nu0": real("nu0 of the noise", self.nu0), "s0": real("s0 of the noise", self.s0)}


@dataclass(frozen=True)
class Correlated(Noise):
    """Errors alike near each other, of unknown sigma and correlation length, which are integrated out.

    ``scale`` is what distances are measured in: "log" or "linear" of the control variable; by the data where it is None.
    """

    s0: float
    nu0: float = 4.0
    scale: str | None = None

    def _spec(self) -> dict[str, Any]:
        if self.scale not in (None, "log", "linear"):
            raise mistake("Correlated scale", repr(self.scale), '"log", "linear" or None')
        spec: dict[str, Any] = {"kind": "correlated", "nu0": real("nu0 of the noise", self.nu0), "s0": real("s0 of the noise", self.s0)}
        return {**spec, "scale": self.scale} if self.scale else spec


@dataclass(frozen=True)
class Robust(Noise):
    """As :class:`Inferred`, with one value in two hundred an outlier that scatters ten times as much."""

    s0: float
    nu0: float = 4.0

    def _spec(self) -> dict[str, Any]:
        return {"kind": "robust", "nu0": real("nu0 of the noise", self.nu0), "s0": real("s0 of the noise", self.s0)}


@dataclass(frozen=True)
class Fixed(Noise):
    """Independent normal errors of a known standard deviation ``sigma`` [unit of the values]: a number, or one per value."""

    sigma: Any

    def _spec(self) -> dict[str, Any]:
        sigma = numbers("Fixed sigma", self.sigma)
        return {"kind": "fixed", "sigma": {"absolute": float(sigma)} if sigma.ndim == 0 else "per-point"}


@dataclass(frozen=True)
class Relative(Noise):
    """Independent normal errors of a known share of each measured value."""

    share: float

    def _spec(self) -> dict[str, Any]:
        return {"kind": "fixed", "sigma": {"relative": real("share of Relative", self.share)}}


@dataclass(frozen=True)
class EssTarget(Noise):
    """GrainLearning's tuning: sigma such that this share of an iteration's samples counts. The result is no posterior."""

    share: float

    def _spec(self) -> dict[str, Any]:
        return {"kind": "ess-target", "share": real("share of EssTarget", self.share)}


class Observations:
    """A measured quantity.

    Parameters
    ----------
    x : array of shape (m,), or None
        The control variable (time, displacement), which never goes back. None where the values are in no order.
    y : array of shape (m,)
        The measured values.
    noise : Noise
        How they scatter: Inferred, Correlated, Robust, Fixed, Relative or EssTarget.
    name, unit : str
        Name of the quantity and unit of ``y``, for tables and figures.
    x_name, x_unit : str
        The same of ``x``.
    """

    def __init__(
        self,
        x: ArrayLike | None,
        y: ArrayLike,
        *,
        noise: Noise,
        name: str | None = None,
        unit: str = "",
        x_name: str = "x",
        x_unit: str = "",
    ) -> None:
        label = f"Observations {name}" if name else "Observations"
        self.x: FloatArray | None = None if x is None else row(f"{label} x", x)
        self.y: FloatArray = row(f"{label} y", y)
        if not isinstance(noise, Noise):
            raise mistake(f"{label} noise", _shown(noise), "a noise model", "noise=Inferred(s0=ABOUT), ABOUT the scatter in the unit of y")
        if self.x is not None and self.x.shape != self.y.shape:
            raise mistake(f"{label} x", f"{self.x.size} numbers", f"{self.y.size}, one for each value of y")
        noise._spec()
        self.noise, self.name = noise, None if name is None else word("Observations name", name)
        self.unit = word(f"{label} unit", unit)
        self.x_name, self.x_unit = word(f"{label} x_name", x_name), word(f"{label} x_unit", x_unit)

    def __len__(self) -> int:
        return int(self.y.size)

    def __repr__(self) -> str:
        return f"Observations({self.name or 'y'}: {len(self)} values, noise={self.noise!r})"

    def _spec(self, name: str) -> dict[str, Any]:
        sigma = None
        if isinstance(self.noise, Fixed) and np.ndim(self.noise.sigma):
            sigma = row(f"observations {name} sigma", self.noise.sigma).tolist()
        return {
            "name": name,
            "control_name": self.x_name,
            "control": None if self.x is None else self.x.tolist(),
            "values": self.y.tolist(),
            "sigma": sigma,
            "unit": self.unit,
            "control_unit": self.x_unit,
            "noise": self.noise._spec(),
        }
