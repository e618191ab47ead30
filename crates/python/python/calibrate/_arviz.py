"""A run for ArviZ: the groups of the workbench as a tree of xarray, as InferenceData, as NetCDF."""

from __future__ import annotations

import json
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np

from . import _calibrate
from ._errors import mistake


def _needed(module: str) -> Any:
    try:
        return import_module(module)
    except ImportError:
        raise ImportError(f"{module} is not installed\n  help: pip install {module}") from None


def datasets(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The attributes of a run, and a dataset of xarray for each of its groups."""
    xarray = _needed("xarray")
    found = _calibrate.groups(folder)

    def array(variable: tuple[Any, ...]) -> Any:
        name, dims, shape, kind, values, attributes = variable
        data = np.frombuffer(values, dtype=kind).reshape(shape)
        return name, (dims, data, _plain(json.loads(attributes)))

    groups = {
        name: xarray.Dataset(dict(map(array, variables)), dict(map(array, coordinates)), {"description": description})
        for name, (description, coordinates, variables) in found["groups"].items()
    }
    return _plain({**json.loads(found["attributes"]), "notes": found["notes"]}), groups


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes as files of NetCDF hold them: numbers and text, lists of several lines."""

    def plain(value: Any) -> Any:
        if isinstance(value, bool):
            return int(value)
        if isinstance(value, list) and all(isinstance(one, str) for one in value):
            return "\n".join(value)
        if isinstance(value, (dict, list)):
            return json.dumps(value)
        return value

    return {name: plain(value) for name, value in attributes.items() if value is not None}


def to_datatree(folder: Path) -> Any:
    """A tree of xarray."""
    attributes, groups = datasets(folder)
    tree_of = getattr(_needed("xarray"), "DataTree", None)
    if tree_of is None:
        raise mistake("xarray", metadata.version("xarray"), "2024.10 or later, which has DataTree", "pip install --upgrade xarray")
    tree = tree_of.from_dict({f"/{name}": group for name, group in groups.items()})
    tree.attrs.update(attributes)
    return tree


def to_arviz(folder: Path) -> Any:
    """What the ArviZ that is installed plots: a tree from 1.0 on, InferenceData before."""
    _needed("arviz")
    if int(metadata.version("arviz").split(".")[0]) >= 1:
        return to_datatree(folder)
    attributes, groups = datasets(folder)
    return import_module("arviz").InferenceData(attrs=attributes, **groups)


def to_netcdf(folder: Path, path: str | Path) -> Path:
    """Writes a file of NetCDF with a group for each group of the run."""
    attributes, groups = datasets(folder)
    engine = next((one for one in ("netCDF4", "h5netcdf") if _there(one)), None)
    if engine is None:
        raise ImportError("groups in NetCDF need netCDF4 or h5netcdf\n  help: pip install netCDF4")
    path, aside = Path(path), Path(path).with_name(f".{Path(path).name}.part")
    try:
        _needed("xarray").Dataset(attrs=attributes).to_netcdf(aside, mode="w", engine=engine.lower())
        for name, group in groups.items():
            group.to_netcdf(aside, mode="a", group=name, engine=engine.lower())
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
    return path


def _there(module: str) -> bool:
    try:
        import_module(module)
    except ImportError:
        return False
    return True
