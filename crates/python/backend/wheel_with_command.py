"""The build backend of the wheel: maturin, with the command `calibrate` put where the wheel takes it from.

`pip wheel crates/python` (or `python -m build --wheel crates/python`) builds the command by cargo, strips it, and lets maturin
pack it beside the module, as a script of the wheel. The script is the Rust program itself: what it starts (jobs of a cluster
that call it again) finds it by its own path.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import maturin
from maturin import (  # noqa: F401  (hooks of PEP 517 that are maturin's own)
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
)

CRATE = Path(__file__).resolve().parent.parent
SCRIPTS = CRATE / "calibrate-dem.data" / "scripts"


def put_command() -> None:
    """Builds the command, and puts it, stripped, among the scripts of the wheel."""
    command = ["cargo", "build", "--release", "--locked", "--package", "calibrate", "--message-format", "json-render-diagnostics"]
    built = subprocess.run(command, cwd=CRATE, check=True, stdout=subprocess.PIPE, text=True)
    messages = [json.loads(line) for line in built.stdout.splitlines() if line.startswith("{")]
    programs = [message["executable"] for message in messages if message.get("executable")]
    if not programs:
        raise SystemExit(f"{' '.join(command)} made no program")
    SCRIPTS.mkdir(parents=True, exist_ok=True)
    script = SCRIPTS / Path(programs[-1]).name
    aside = script.with_name(f".{script.name}.{os.getpid()}")
    shutil.copy2(programs[-1], aside)
    if strip := shutil.which("strip"):
        subprocess.run([strip, str(aside)], check=True)
    os.replace(aside, script)


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """Writes the metadata, for which maturin wants the folder of the scripts to be there."""
    SCRIPTS.mkdir(parents=True, exist_ok=True)
    return str(maturin.prepare_metadata_for_build_wheel(metadata_directory, config_settings))


def build_wheel(wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None) -> str:
    """Builds the wheel."""
    put_command()
    return str(maturin.build_wheel(wheel_directory, config_settings, metadata_directory))


def build_editable(wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None) -> str:
    """Builds a wheel that leads to the sources."""
    put_command()
    return str(maturin.build_editable(wheel_directory, config_settings, metadata_directory))


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """Refuses: the sources are those of the whole workspace."""
    raise SystemExit("there is no source distribution of the Python package alone; build the wheel in a checkout: pip wheel crates/python")
