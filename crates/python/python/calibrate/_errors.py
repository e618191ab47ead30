"""Exceptions of the module. Each says where, what was seen, what was expected, and what helps."""

from __future__ import annotations

from typing import Any

from ._calibrate import InputMistake, RunFailed


class SimulatorMistake(InputMistake):
    """A simulator that does not do what it must: it returns values of the wrong shape, or what is no number."""


def mistake(place: str, found: Any, expected: str, remedy: str | None = None, of: type[InputMistake] = InputMistake) -> InputMistake:
    """An error in the words of the command."""
    text = f"{place}: found {found}, expected {expected}"
    return of(f"{text}\n  help: {remedy}" if remedy else text)


__all__ = ["InputMistake", "RunFailed", "SimulatorMistake", "mistake"]
