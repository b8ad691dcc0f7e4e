"""Units of an SBML file: what one unit of substance, volume and time is in mol, m³ and s."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from particell.errors import InputError
from particell.materials import AVOGADRO
from particell.units import parse

SI = {"substance": "mol", "volume": "m^3", "time": "s"}
#: What a kind of unit is in SI units, as (dimension, exponent of it, factor).
_KINDS = {
    "mole": ("substance", 1, 1.0),
    "item": ("substance", 1, 1 / AVOGADRO),
    "avogadro": ("", 1, AVOGADRO),
    "litre": ("length", 3, 1e-3),
    "liter": ("length", 3, 1e-3),
    "metre": ("length", 1, 1.0),
    "meter": ("length", 1, 1.0),
    "second": ("time", 1, 1.0),
    "dimensionless": ("", 1, 1.0),
}
_WANTED = {"substance": {"substance": 1.0}, "volume": {"length": 3.0}, "time": {"time": 1.0}}
#: What level 2 means where it says nothing.
_LEVEL_2 = {"substance": "mole", "volume": "litre", "time": "second"}


class Units:
    """Reads the units of a model.

    Parameters
    ----------
    model
        Of libSBML.
    given
        What to take where the file says nothing: ``{"substance": "nmol", "time": "min"}``.
    notes
        Is told which of them the file says itself.
    """

    def __init__(self, model: Any, given: Mapping[str, str], notes: list[str]):
        self.model, self.given = model, dict(given)
        for key in self.given:
            if key not in SI:
                raise InputError("units", key, f"of {', '.join(SI)}")
            parse(f"units: {key}", f"1 {self.given[key]}", SI[key])
            own = self._default(key)
            if own and not self._plain(own, key):
                factor = self.value(key)
                notes.append(
                    f"units: '{self.given[key]}' for {key} is not used: the file says "
                    f"'{own}' ({factor:g} {SI[key]})"
                )

    def value(self, kind: str, name: str = "", where: str = "the model") -> float:
        """One unit of ``kind`` (``"substance"``, ``"volume"``, ``"time"``) in SI.

        Parameters
        ----------
        kind
            Which.
        name
            The unit that an element names itself; empty where it leaves it to the model.
        where
            The element, for messages.
        """
        name = name or self._default(kind)
        if not name or self._plain(name, kind):
            if kind in self.given:
                return parse(f"units: {kind}", f"1 {self.given[kind]}", SI[kind])
            missing = {k: u for k, u in SI.items() if k not in self.given and not self._default(k)}
            allowed = f"given in the file or by units={missing}, say"
            raise InputError(f"units of {kind} of {where}", None, allowed)
        factor, dimensions = self._unit(name)
        if dimensions != _WANTED[kind]:
            allowed = f"of the dimension of {SI[kind]}"
            if not dimensions:
                allowed += f", or be said by units={{'{kind}': …}}"
            raise InputError(f"units of {kind} of {where}", name, allowed)
        return factor

    def extent(self) -> float:
        """One unit of a reaction's extent in mol."""
        name = self.model.getExtentUnits() if self.model.getLevel() > 2 else ""
        return self.value("substance", name, "extent")

    def _default(self, kind: str) -> str:
        if self.model.getLevel() > 2:
            return getattr(self.model, f"get{kind.capitalize()}Units")()
        # in level 2 these names are units, which a file may define anew
        return kind if self.model.getUnitDefinition(kind) else _LEVEL_2[kind]

    def _plain(self, name: str, kind: str) -> bool:
        """Whether a file says that something has no unit, and one is given."""
        return kind in self.given and not self._unit(name)[1]

    def _unit(self, name: str) -> tuple[float, dict[str, float]]:
        definition = self.model.getUnitDefinition(name)
        if definition is None:
            name = _LEVEL_2.get(name, name) if self.model.getLevel() == 2 else name
            if name not in _KINDS:
                raise InputError("unit", name, f"made of {', '.join(_KINDS)}")
            dimension, power, factor = _KINDS[name]
            return factor, {dimension: float(power)} if dimension else {}
        total = 1.0
        dimensions: dict[str, float] = {}
        for k in range(definition.getNumUnits()):
            unit = definition.getUnit(k)
            kind = _kind(unit)
            if kind not in _KINDS or unit.getOffset():
                raise InputError(f"unit {name}", kind, f"made of {', '.join(_KINDS)}, no offset")
            dimension, power, factor = _KINDS[kind]
            exponent = unit.getExponentAsDouble()
            total *= (unit.getMultiplier() * 10.0 ** unit.getScale() * factor) ** exponent
            if dimension:
                dimensions[dimension] = dimensions.get(dimension, 0.0) + power * exponent
        return total, {d: e for d, e in dimensions.items() if e}


def _kind(unit: Any) -> str:
    import libsbml

    return str(libsbml.UnitKind_toString(unit.getKind()))
