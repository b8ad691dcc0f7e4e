"""The named constants of a case file, and the formulas that hold nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from particell.casefile.formula import AXES, BUILT_IN, RESERVED, TIME, Formula, is_formula
from particell.casefile.ordered import resolve_all
from particell.errors import InputError
from particell.units import quantity, registry

#: Keys of what may be a formula of other names than constants.
_LATER = ("rate_law", "propensity")


class Constants:
    """Constants by name: numbers, quantities with units, formulas of other constants.

    Parameters
    ----------
    given
        As they stand in the file.

    Attributes
    ----------
    values
        SI numbers by name, with those that are built in.
    quantities
        The same with units.

    Raises
    ------
    InputError
        Where one is wrong, is reserved, or depends on itself.
    """

    def __init__(self, given: Mapping[str, Any]):
        units = registry()
        self.quantities = {k: units.Quantity(v, unit) for k, (v, unit) in BUILT_IN.items()}
        self.values = {k: v for k, (v, _) in BUILT_IN.items()}
        for name in given:
            if not str(name).isidentifier():
                raise InputError("constant", name, "named by letters, digits and underscores")
            if name in RESERVED:
                raise InputError("constant", name, "another name: formulas have their own of that")
        formulas = {k: Formula(f"constants.{k}", v) for k, v in given.items() if is_formula(v)}
        for name, value in given.items():
            if name not in formulas:
                self._set(name, self._plain(f"constants.{name}", value))
        for formula in formulas.values():
            formula.require({*self.values, *formulas})
        needs = {k: [n for n in f.names if n in formulas] for k, f in formulas.items()}
        for name in resolve_all("constants", needs):
            self._set(name, self.evaluate(formulas[name]))

    def _set(self, name: str, value: Any) -> None:
        self.quantities[name], self.values[name] = value, float(value.magnitude)

    @staticmethod
    def _plain(key: str, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise InputError(key, value, "a number, text with a unit, or a formula after '='")
        try:
            return quantity(value) if isinstance(value, str) else registry().Quantity(_float(value))
        except ValueError as error:
            raise InputError(key, value, str(error)) from None

    def evaluate(self, formula: Formula) -> Any:
        """A formula of constants as one of pint's quantities."""
        formula.require(self.values)
        value = float(formula.value(self.values))
        if not math.isfinite(value):
            raise formula.error("a formula with a finite result")
        return registry().Quantity(value, formula.dimension(self.quantities).units)

    def replace(self, value: Any, key: str = "") -> Any:
        """A file's value with all formulas of constants alone worked out, in tables and lists.

        Formulas of the coordinates and of time are left as they are.
        """
        if isinstance(value, Mapping):
            return {
                k: v if k in _LATER else self.replace(v, f"{key}.{k}".lstrip("."))
                for k, v in value.items()
            }
        if isinstance(value, list | tuple):
            return [self.replace(v, f"{key} #{k + 1}") for k, v in enumerate(value)]
        if is_formula(value):
            formula = Formula(key, value)
            formula.require({*self.values, *AXES, TIME})
            if formula.names.isdisjoint((*AXES, TIME)):
                return self.evaluate(formula)
        return value


def _float(value: float) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("a finite number")
    return number
