r"""Species and reactions from an SBML file (levels 2 and 3, core).

A kinetic law of SBML is the *extent* of a reaction per time in its whole compartment: it counts
events, as rates do here, so that ``2 A -> B`` with the law :math:`k A^2` has
:math:`dA/dt = -2 k A^2`, without a factor ½ anywhere. Divided by the compartment's volume it is the
rate in mol/m³/s that a :class:`~particell.chemistry.reactions.Reaction` has.

A law that is a product of powers of species as mass action has it becomes a rate constant; the
falling factorials of laws for molecules, such as :math:`k A (A - 1)/2`, are recognised. So are
differences of two such terms (reversible reactions), and modifiers as catalysts on both sides. Any
other formula of + - * / and powers becomes a rate law (for molecules: a propensity), which Numba
compiles from the tree that libSBML parsed. A difference that is no mass action is made two one-way
reactions. All else is refused by name: nothing is left out silently.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from particell.chemistry.reactions import Reaction
from particell.chemistry.sbml_laws import Laws, Participant
from particell.chemistry.sbml_units import Units
from particell.chemistry.species import Species
from particell.errors import InputError, unknown_name
from particell.representation import block, table
from particell.units import parse

if TYPE_CHECKING:
    from particell.chemistry.engine import Chemistry

Diffusivity = float | str | Mapping[str, Any]


@dataclass(frozen=True)
class SBMLModel:
    """What a file describes, in SI units.

    Attributes
    ----------
    species, reactions
        For :class:`~particell.simulation.Simulation`.
    initial
        Concentrations at t = 0 in mol/m³, by species.
    constants
        Concentrations in mol/m³ of species that the file holds constant (boundary conditions);
        they are part of the rates and are no species of the simulation.
    volumes
        Volumes of the compartments in m³.
    parameters
        Global parameters, as numbers in the file's own units.
    kinds
        What each reaction of the file has become: ``"mass action"`` or ``"rate law"``.
    notes
        What a reader should know: approximations made, and units that libSBML finds inconsistent.
    """

    species: list[Species]
    reactions: list[Reaction]
    initial: dict[str, float]
    constants: dict[str, float] = field(default_factory=dict)
    volumes: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def _repr_html_(self) -> str:
        from particell.chemistry.listing import reaction_table, species_table

        return block(
            f"SBML model: {len(self.species)} species, {len(self.reactions)} reactions",
            species_table(self.species),
            reaction_table(self.reactions),
            table(self.initial.items(), ("species", "at t = 0 [mol/m³]")),
            table(self.constants.items(), ("held constant", "[mol/m³]")),
            table([(note,) for note in self.notes], ("notes",)),
        )

    def set_initial(self, chemistry: Chemistry) -> None:
        """Give all particles the initial concentrations."""
        for name, concentration in self.initial.items():
            chemistry.set_concentration(name, concentration)


def read_sbml(
    path: str | Path,
    diffusivity: Diffusivity = 0.0,
    molecules: bool | Collection[str] = False,
    only_in: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> SBMLModel:
    """Read species and reactions from an SBML file.

    Parameters
    ----------
    path
        The file, of level 2 or 3.
    diffusivity
        In m²/s or as text with a unit: one for all species, or by the species' ids (others: 0;
        each may be a table by group, as for :class:`Species`).
    molecules
        Which species are whole molecules: True, False, or their ids.
    only_in
        The group or groups of particles that stand for a compartment, by its id; by default
        species are wherever :class:`Species` puts them.
    units
        Units of ``"substance"``, ``"volume"`` and ``"time"`` where the file has none:
        ``{"substance": "nmol", "volume": "l", "time": "min"}``.

    Returns
    -------
    SBMLModel
        Everything in SI units.

    Raises
    ------
    InputError
        Where libSBML is missing, the file cannot be read, or holds what cannot be represented:
        events, rules, constraints, delays, time in laws, fast reactions, conversion factors,
        reactions between compartments, compartments that are no volumes or change, functions
        other than powers, stoichiometries that are not whole.
    """
    return parse_sbml(sbml_text(path), path, diffusivity, molecules, only_in, units)


def sbml_text(path: str | Path) -> str:
    """What an SBML file holds.

    Raises
    ------
    InputError
        Where it is no readable text.
    """
    if not Path(path).is_file():
        raise InputError("SBML file", str(path), "a readable file")
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        allowed = f"a readable file in UTF-8 ({getattr(error, 'strerror', None) or 'it is not'})"
        raise InputError("SBML file", str(path), allowed) from None


def parse_sbml(
    text: str,
    path: str | Path,
    diffusivity: Diffusivity = 0.0,
    molecules: bool | Collection[str] = False,
    only_in: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> SBMLModel:
    """As :func:`read_sbml`, from the text of a file; ``path`` is what messages call it."""
    document, notes = _document(text, Path(path))  # kept: libSBML's objects die with it
    model = document.getModel()
    _refuse(model)
    reader = Units(model, units or {})
    volumes, sizes = _compartments(model, reader)
    participants = {
        s.getId(): _participant(s, reader, volumes) for s in _items(model.getListOfSpecies())
    }
    free = {name: p for name, p in participants.items() if not p.constant}
    chosen = _chosen("molecules", molecules, free)
    places = _places(only_in or {}, volumes)
    if isinstance(diffusivity, Mapping):
        _known("diffusivity", diffusivity, free)
    species = [
        Species(
            name,
            _diffusivity(name, diffusivity),
            molecules=name in chosen,
            only_in=places.get(p.compartment),
        )
        for name, p in free.items()
    ]
    parameters = {p.getId(): _number("parameter", p) for p in _items(model.getListOfParameters())}
    laws = Laws(
        participants, chosen, volumes, {**parameters, **sizes}, places, notes,
        reader.extent() / reader.value("time"),
    )  # fmt: skip
    reactions: list[Reaction] = []
    for r in _items(model.getListOfReactions()):
        reactions += laws.reactions(r)
    return SBMLModel(
        species=species,
        reactions=reactions,
        initial={name: p.initial for name, p in free.items()},
        constants={name: p.initial for name, p in participants.items() if p.constant},
        volumes=volumes,
        parameters=parameters,
        kinds=laws.kinds,
        notes=notes,
    )


def _document(text: str, path: Path) -> tuple[Any, list[str]]:
    try:
        import libsbml
    except ImportError:
        allowed = "read where libSBML is installed (pip install 'particell[sbml]')"
        raise InputError("SBML file", str(path), allowed) from None
    document = libsbml.readSBMLFromString(text)
    _raise_errors(path, document)
    if document.getLevel() not in (2, 3):
        raise InputError("SBML level", document.getLevel(), "2 or 3")
    if document.getModel() is None:
        raise InputError("SBML file", str(path), "one with a model")
    for k in range(document.getNumPlugins() if document.getLevel() > 2 else 0):
        name = document.getPlugin(k).getPackageName()
        if document.getPackageRequired(name):
            raise InputError("SBML package", name, "left out: only core SBML is read")
    document.checkConsistency()
    notes = _raise_errors(path, document)
    for option in ("expandFunctionDefinitions", "expandInitialAssignments"):
        properties = libsbml.ConversionProperties()
        properties.addOption(option, True)
        document.convert(properties)
    return document, notes


#: libSBML's numbers for "some units are not declared, so they were not checked".
_UNDECLARED = range(99500, 99600)


def _raise_errors(path: Path, document: Any) -> list[str]:
    """Refuse a file with errors; inconsistent units are notes (formulas have no conversions)."""
    import libsbml

    notes = []
    for k in range(document.getNumErrors()):
        error = document.getError(k)
        line = " ".join(error.getMessage().split())
        if error.getCategory() == libsbml.LIBSBML_CAT_UNITS_CONSISTENCY:
            if error.getErrorId() not in _UNDECLARED:
                notes.append(f"line {error.getLine()}: {line}")
        elif error.getSeverity() >= libsbml.LIBSBML_SEV_ERROR:
            raise InputError("SBML file", str(path), f"valid (line {error.getLine()}: {line})")
    return notes


def _refuse(model: Any) -> None:
    """Refuse by name what a set of reactions cannot represent."""
    for what, found in (
        ("rule", model.getListOfRules()),
        ("event", model.getListOfEvents()),
        ("constraint", model.getListOfConstraints()),
        ("initial assignment", model.getListOfInitialAssignments()),
    ):
        for item in _items(found):
            name = _name_of(item)
            kind = item.getElementName() if what == "rule" else what
            if what == "initial assignment":
                raise InputError(kind, name, "one that libSBML can turn into a number")
            raise InputError(f"SBML {kind}", name, "left out: only reactions are represented")
    for item in (*_items(model.getListOfSpecies()), model):
        if item.isSetConversionFactor():
            raise InputError("conversion factor", _name_of(item), "left out")
    for item in _items(model.getListOfSpecies()):
        if item.isSetSpatialSizeUnits():
            raise InputError("spatialSizeUnits of species", item.getId(), "left out")
    for item in _items(model.getListOfReactions()):
        law = item.getKineticLaw()
        if law is not None and (law.isSetSubstanceUnits() or law.isSetTimeUnits()):
            raise InputError("units of the kinetic law of reaction", item.getId(), "left out")


def _name_of(item: Any) -> str:
    for getter in ("getVariable", "getSymbol", "getId", "getName"):
        name = getattr(item, getter, str)()
        if name:
            return str(name)
    return "(without a name)"


def _compartments(model: Any, units: Units) -> tuple[dict[str, float], dict[str, float]]:
    """Volumes in m³, and as they are written."""
    volumes, sizes = {}, {}
    for c in _items(model.getListOfCompartments()):
        name = c.getId()
        if c.getSpatialDimensionsAsDouble() != 3:
            dimensions = c.getSpatialDimensionsAsDouble()
            raise InputError(f"dimensions of compartment {name}", dimensions, "3")
        if not c.getConstant():
            raise InputError(f"compartment {name}", "changing", "of constant size")
        if not (c.isSetSize() and c.getSize() > 0):
            raise InputError(f"size of compartment {name}", None, "given and positive")
        sizes[name] = float(c.getSize())
        volumes[name] = sizes[name] * units.value("volume", c.getUnits(), f"compartment {name}")
    return volumes, sizes


def _participant(s: Any, units: Units, volumes: Mapping[str, float]) -> Participant:
    name, where = s.getId(), s.getCompartment()
    substance = units.value("substance", s.getSubstanceUnits(), f"species {name}")
    compartment = s.getModel().getCompartment(where)
    volume_unit = units.value("volume", compartment.getUnits(), f"compartment {where}")
    if s.isSetInitialConcentration():
        initial = s.getInitialConcentration() * substance / volume_unit
    elif s.isSetInitialAmount():
        initial = s.getInitialAmount() * substance / volumes[where]
    else:
        raise InputError(f"initial value of species {name}", None, "given")
    if not initial >= 0:
        raise InputError(f"initial value of species {name}", initial, "a number >= 0")
    amounts = s.getHasOnlySubstanceUnits()
    return Participant(
        compartment=where,
        initial=initial,
        # one mol/m³ in the unit of the symbol: an amount, or a concentration
        scale=(volumes[where] if amounts else volume_unit) / substance,
        constant=bool(s.getConstant() or s.getBoundaryCondition()),
    )


def _chosen(key: str, names: bool | Collection[str], known: Mapping[str, Any]) -> set[str]:
    if isinstance(names, bool):
        return set(known) if names else set()
    names = {names} if isinstance(names, str) else set(names)
    _known(key, names, known)
    return names


def _known(key: str, names: Collection[str], known: Collection[str]) -> None:
    for name in names:
        if name not in known:
            raise unknown_name(f"species in {key}", name, known)


def _places(only_in: Mapping[str, Any], volumes: Mapping[str, float]) -> dict[str, Any]:
    for name in only_in:
        if name not in volumes:
            raise unknown_name("compartment in only_in", name, volumes)
    return dict(only_in)


def _diffusivity(name: str, given: Diffusivity) -> Any:
    value = given.get(name, 0.0) if isinstance(given, Mapping) else given
    key = f"diffusivity of {name}"
    if isinstance(value, Mapping):
        return {g: parse(f"{key} in {g}", v, "m^2/s") for g, v in value.items()}
    return parse(key, value, "m^2/s")


def _number(what: str, item: Any) -> float:
    value = float(item.getValue()) if item.isSetValue() else float("nan")
    if value != value:
        raise InputError(f"{what} {item.getId()}", None, "given a value")
    return value


def _items(found: Any) -> list[Any]:
    return [found.get(k) for k in range(found.size())]
