"""The groups of a run, as ArviZ and xarray read them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import Y

import calibrate as cal

xarray = pytest.importorskip("xarray", reason="SKIPPED: xarray is not installed")
GROUPS = {"posterior", "prior", "log_likelihood", "posterior_predictive", "observed_data", "sample_stats"}


def test_arviz_has_the_groups_with_the_moments_of_the_summary(line_run: cal.Run) -> None:
    arviz = pytest.importorskip("arviz", reason="SKIPPED: arviz is not installed")
    found = line_run.to_arviz()
    names = set(found.groups()) if callable(found.groups) else {group.strip("/") for group in found.groups}
    assert names >= GROUPS
    for name in line_run.parameters:
        own, drawn = line_run.marginal(name), found["posterior"][name]
        assert drawn.dims == ("chain", "draw") and drawn.attrs["units"] == "1"
        assert abs(float(drawn.mean()) - own.mean) < 0.4 * own.sd
        assert abs(float(drawn.std()) / own.sd - 1) < 0.3
    assert np.array_equal(found["observed_data"]["y"].values, Y)
    assert found.attrs["khat"] == pytest.approx(line_run.trust.khat) if "khat" in found.attrs else True
    loo = arviz.loo(found)
    assert np.isfinite(float(getattr(loo, "elpd_loo", getattr(loo, "elpd", np.nan))))
    assert "a" in str(arviz.summary(found))


def test_netcdf_reads_back_as_the_tree(line_run: cal.Run, tmp_path: Path) -> None:
    pytest.importorskip("netCDF4", reason="SKIPPED: netCDF4 is not installed")
    path = line_run.to_netcdf(tmp_path / "line.nc")
    assert [file.name for file in tmp_path.iterdir()] == ["line.nc"]
    tree = xarray.open_datatree(path)
    wanted = line_run.to_datatree()
    for group in GROUPS:
        for name, variable in wanted[group].data_vars.items():
            assert np.array_equal(tree[group][name].values, variable.values, equal_nan=True), (group, name)
    tree.close()


def test_exports_are_those_of_the_command(line_run: cal.Run, run_command, tmp_path: Path) -> None:
    saved = line_run.save(tmp_path / "line")
    for name in ("idata-json", "stan-csv", "draws-csv", "zarr"):
        own = line_run.export(name, tmp_path / "own")
        run_command("export", saved, "--format", name, "--out", tmp_path / "theirs", cwd=tmp_path)
        theirs = tmp_path / "theirs" / own.name
        files = [own] if own.is_file() else sorted(path for path in own.rglob("*") if path.is_file())
        assert files
        for file in files:
            assert file.read_bytes() == (theirs if own.is_file() else theirs / file.relative_to(own)).read_bytes(), file
    tree = xarray.open_datatree(tmp_path / "own" / "posterior.zarr", engine="zarr") if _has("zarr") else None
    assert tree is None or np.array_equal(tree["posterior"]["a"].values, line_run.to_datatree()["posterior"]["a"].values)
    with pytest.raises(cal.InputMistake, match="stan-csv"):
        line_run.export("stan", tmp_path)


def _has(module: str) -> bool:
    import importlib.util

    return importlib.util.find_spec(module) is not None


def test_a_run_of_tuned_noise_is_no_posterior_and_is_refused() -> None:
    from conftest import LINE, line, measured

    run = cal.calibrate(line, LINE, measured(noise=cal.EssTarget(0.5)), samples=64)
    with pytest.raises(cal.InputMistake, match="no posterior"):
        run.to_datatree()
