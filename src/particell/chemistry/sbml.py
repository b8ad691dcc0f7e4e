r"""Species and reactions from an SBML file (levels 2 and 3, core).

A kinetic law of SBML is the *extent* of a reaction per time in its whole compartment: it counts
events, as rates do here, so that ``2 A -> B`` with the law :math:`k A^2` has
:math:`dA/dt = -2 k A^2`, without a factor ½ anywhere. Divided by the compartment's volume it is the
rate in mol/m³/s that a :class:`~particell.chemistry.reactions.Reaction` has.

A law that is a product of powers of species as mass action has it becomes a rate constant; the
falling factorials of laws for molecules, such as :math:`k A (A - 1)/2`, are recognised. So are
differences of two such terms (reversible reactions), and modifiers as catalysts on both sides. Any
other formula becomes a rate law (for molecules: a propensity), which Numba compiles from the tree
that libSBML parsed. A difference that is no mass action is made two one-way reactions where it can
be taken apart. Function definitions are expanded, assignment rules put into the laws that use
them, initial assignments and constants worked out. All else is refused by name: nothing is left
out silently.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from particell.chemistry.formula import Tree, value
from particell.chemistry.reactions import Reaction
from particell.chemistry.sbml_laws import Laws
from particell.chemistry.sbml_math import refuse_growth
from particell.chemistry.sbml_symbols import Symbols, items
from particell.chemistry.sbml_units import Units
from particell.chemistry.species import Species
from particell.errors import InputError, MissingExtra, unknown_name
from particell.representation import block, table
from particell.units import parse

if TYPE_CHECKING:
    from particell.chemistry.engine import Chemistry

Diffusivity = float | str | Mapping[str, Any]


@dataclass(frozen=True)
class Assigned:
    """What an assignment rule gives to a parameter or a species, in the file's units."""

    tree: Tree

    def __call__(self, concentrations: Mapping[str, Any], time: Any = 0.0) -> Any:
        """Its value.

        Parameters
        ----------
        concentrations
            Numbers or arrays in mol/m³, by species.
        time
            In s.
        """
        return value(self.tree, concentrations, time)


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
    assigned
        What assignment rules define: functions of the concentrations and the time.
    volumes
        Volumes of the compartments in m³.
    parameters
        Global parameters, as numbers in the file's own units.
    kinds
        What each reaction of the file has become: ``"mass action"``, ``"rate law"`` or
        ``"nothing"``.
    notes
        What a reader should know: assumptions made, what has no effect, and units that libSBML
        finds inconsistent.
    """

    species: list[Species]
    reactions: list[Reaction]
    initial: dict[str, float]
    constants: dict[str, float] = field(default_factory=dict)
    assigned: dict[str, Assigned] = field(default_factory=dict)
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
    volumes: Mapping[str, float | str] | None = None,
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
        ``{"substance": "nmol", "volume": "l", "time": "min"}``. Where it has them a note says
        that these are not used.
    volumes
        The volume that a compartment stands for, in m³ or as text with a unit, by its id: where
        the file gives no size, or a membrane's area. Numbers in the file stay as they are. Of
        compartments between which something reacts it has to be the same: they share its space,
        and the concentrations of their species are per volume of it.

    Returns
    -------
    SBMLModel
        Everything in SI units.

    Raises
    ------
    InputError
        Where libSBML is missing, the file cannot be read, or holds what cannot be represented:
        events, algebraic and rate rules, delays, fast reactions, compartments that change,
        reactions between compartments that were not given one volume, packages that a file
        requires.
    """
    return parse_sbml(sbml_text(path), path, diffusivity, molecules, only_in, units, volumes)


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
        return Path(path).read_bytes().decode("utf-8-sig")  # Windows writes a byte order mark
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
    volumes: Mapping[str, float | str] | None = None,
) -> SBMLModel:
    """As :func:`read_sbml`, from the text of a file; ``path`` is what messages call it."""
    document, notes = _document(text, Path(path))  # kept: libSBML's objects die with it
    model = document.getModel()
    _refuse(model, notes)
    reader = Units(model, units or {}, notes)
    symbols = Symbols(model, reader, volumes or {}, notes)
    participants = symbols.participants
    free = {name: p for name, p in participants.items() if not p.constant}
    chosen = _chosen("molecules", molecules, free)
    places = _places(only_in or {}, symbols.volumes)
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
    laws = Laws(symbols, chosen, places, notes)
    reactions: list[Reaction] = []
    for r in items(model.getListOfReactions()):
        reactions += laws.reactions(r)
    names = [p.getId() for p in items(model.getListOfParameters())]
    return SBMLModel(
        species=species,
        reactions=reactions,
        initial={name: p.initial for name, p in free.items()},
        constants={name: p.initial for name, p in participants.items() if p.constant},
        assigned={name: Assigned(tree) for name, tree in symbols.assigned.items()},
        volumes=symbols.volumes,
        parameters={name: symbols.number(name) for name in names if name not in symbols.assigned},
        kinds=laws.kinds,
        notes=notes,
    )


def _document(text: str, path: Path) -> tuple[Any, list[str]]:
    try:
        import libsbml
    except ImportError:
        raise MissingExtra(f"reading the SBML file {path}", "libSBML", "sbml") from None
    document = libsbml.readSBMLFromString(text)
    _raise_errors(path, document)
    if document.getLevel() not in (2, 3):
        raise InputError("SBML level", document.getLevel(), "2 or 3")
    if document.getModel() is None:
        raise InputError("SBML file", str(path), "one with a model")
    for k in range(document.getNumPlugins() if document.getLevel() > 2 else 0):
        name = document.getPlugin(k).getPackageName()
        # libSBML's plugin for the functions that version 2 of level 3 has is no package of a file
        if name != "l3v2extendedmath" and document.getPackageRequired(name):
            raise InputError("SBML package", name, "left out: only core SBML is read")
    refuse_growth(document.getModel())  # which libSBML would follow to its end
    document.checkConsistency()
    notes = _raise_errors(path, document)
    return document, notes


#: libSBML's numbers for "some units are not declared, so they were not checked".
_UNDECLARED = (20702, *range(99500, 99600))


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


def _refuse(model: Any, notes: list[str]) -> None:
    """Refuse by name what a set of reactions cannot represent."""
    for event in items(model.getListOfEvents()):
        raise InputError("SBML event", _name_of(event), "left out: only reactions are represented")
    for rule in items(model.getListOfRules()):
        if not rule.isAssignment():
            kind, name = f"SBML {rule.getElementName()}", _name_of(rule)
            raise InputError(kind, name, "left out: assignment rules and reactions are represented")
    if model.getListOfConstraints().size():
        notes.append("constraints are not watched")
    for item in items(model.getListOfReactions()):
        law = item.getKineticLaw()
        if law is not None and (law.isSetSubstanceUnits() or law.isSetTimeUnits()):
            raise InputError("units of the kinetic law of reaction", item.getId(), "left out")


def _name_of(item: Any) -> str:
    for getter in ("getVariable", "getSymbol", "getId", "getName"):
        name = getattr(item, getter, str)()
        if name:
            return str(name)
    return "(without a name)"


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
