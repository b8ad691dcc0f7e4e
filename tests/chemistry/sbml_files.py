"""Small SBML files, written by hand."""

from __future__ import annotations

import re
from pathlib import Path

MATHML = "http://www.w3.org/1998/Math/MathML"

#: mmol, litres and minutes.
UNITS = """
<listOfUnitDefinitions>
  <unitDefinition id="mmol"><listOfUnits>
    <unit kind="mole" exponent="1" scale="-3" multiplier="1"/></listOfUnits></unitDefinition>
  <unitDefinition id="minute"><listOfUnits>
    <unit kind="second" exponent="1" scale="0" multiplier="60"/></listOfUnits></unitDefinition>
</listOfUnitDefinitions>
"""


SYMBOL = '<csymbol encoding="text" definitionURL="http://www.sbml.org/sbml/symbols/{0}"> {0} '
CONSTANTS = ("pi", "exponentiale", "true", "false")


def math(formula: str) -> str:
    """Content MathML of a formula such as ``(* cell k A)``: prefix notation in brackets.

    ``(piecewise 1 (lt A 2) 3)`` has values and conditions in turn, ``(root degree 3 A)`` and
    ``(log logbase 2 A)`` a degree or a base; ``time`` and ``avogadro`` are the symbols of SBML.
    """
    tokens = formula.replace("(", " ( ").replace(")", " ) ").split()
    names = {"+": "plus", "-": "minus", "*": "times", "/": "divide", "^": "power"}

    def parse() -> str:
        token = tokens.pop(0)
        if token != "(":
            return leaf(token)
        function, parts = tokens.pop(0), []
        while tokens[0] != ")":
            if tokens[0] in ("degree", "logbase"):
                qualifier = tokens.pop(0)
                parts.append(f"<{qualifier}>{parse()}</{qualifier}>")
            else:
                parts.append(parse())
        tokens.pop(0)
        if function == "piecewise":
            pairs = zip(parts[::2], parts[1::2], strict=False)
            inner = "".join(f"<piece>{value}{condition}</piece>" for value, condition in pairs)
            rest = f"<otherwise>{parts[-1]}</otherwise>" if len(parts) % 2 else ""
            return f"<piecewise>{inner}{rest}</piecewise>"
        if function in ("delay", "rateOf"):
            return f"<apply>{SYMBOL.format(function)}</csymbol>{''.join(parts)}</apply>"
        return f"<apply><{names.get(function, function)}/>{''.join(parts)}</apply>"

    def leaf(token: str) -> str:
        if token in CONSTANTS:
            return f"<{token}/>"
        if token in ("time", "avogadro"):
            return SYMBOL.format(token) + "</csymbol>"
        try:
            float(token)
        except ValueError:
            return f"<ci> {token} </ci>"
        return f"<cn> {token} </cn>"

    return f'<math xmlns="{MATHML}">{parse()}</math>'


def species(name: str, initial: str, amounts: bool = False, **more: str) -> str:
    attributes = {
        "hasOnlySubstanceUnits": str(amounts).lower(),
        "boundaryCondition": "false",
        "constant": "false",
        **more,
    }
    rest = " ".join(f'{k}="{v}"' for k, v in attributes.items())
    kind, _, value = initial.partition("=")
    return f'<species id="{name}" compartment="cell" initial{kind}="{value}" {rest}/>'


def reaction(
    name: str,
    left: str,
    right: str,
    formula: str,
    local: str = "",
    reversible: bool = False,
    modifiers: str = "",
    fast: bool = False,
) -> str:
    """Sides as ``"2 A + B"``; local parameters as ``"k=1 m=2"``."""

    def side(tag: str, text: str) -> str:
        found = ""
        for term in filter(None, (t.strip() for t in text.split("+"))):
            *number, what = term.split()
            n = number[0] if number else "1"
            found += f'<speciesReference species="{what}" stoichiometry="{n}" constant="true"/>'
        return f"<{tag}>{found}</{tag}>" if found else ""

    modified = "".join(f'<modifierSpeciesReference species="{m}"/>' for m in modifiers.split())
    parameters = "".join(
        '<localParameter id="{}" value="{}"/>'.format(*p.split("=")) for p in local.split()
    )
    return (
        f'<reaction id="{name}" reversible="{str(reversible).lower()}" fast="{str(fast).lower()}">'
        + side("listOfReactants", left)
        + side("listOfProducts", right)
        + (f"<listOfModifiers>{modified}</listOfModifiers>" if modified else "")
        + f"<kineticLaw>{math(formula)}"
        + (f"<listOfLocalParameters>{parameters}</listOfLocalParameters>" if parameters else "")
        + "</kineticLaw></reaction>"
    )


def write(
    path: Path,
    content: list[str],
    reactions: list[str],
    parameters: str = "",
    extra: str = "",
    functions: str = "",
    volume: float | None = 2.0,
    dimensions: int = 3,
    substance: str = "mmol",
    more: str = "",
    time: str = "minute",
    version: int = 1,
    extent: str = "",
    head: str = "",
    fixed: bool = True,
) -> Path:
    """A file of level 3 with one compartment ``cell`` in litres."""
    given = "".join(
        '<parameter id="{}" value="{}" constant="true"/>'.format(*p.split("="))
        for p in parameters.split()
    )
    size = "" if volume is None else f' size="{volume}"'
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>'
        f'<sbml xmlns="http://www.sbml.org/sbml/level3/version{version}/core" level="3" '
        f'version="{version}"><model id="model" substanceUnits="{substance}" '
        f'extentUnits="{extent or substance}" volumeUnits="litre" timeUnits="{time}"{head}>'
        f"{functions}{UNITS}"
        f'<listOfCompartments><compartment id="cell"{size} '
        f'constant="{str(fixed).lower()}" '
        f'spatialDimensions="{dimensions}"/></listOfCompartments>'
        f"<listOfSpecies>{''.join(content)}</listOfSpecies>"
        + (f"<listOfParameters>{given}{more}</listOfParameters>" if given or more else "")
        + extra.partition("|")[0]
        + (f"<listOfReactions>{''.join(reactions)}</listOfReactions>" if reactions else "")
        + extra.partition("|")[2]
        + "</model></sbml>"
    )
    if version > 1:
        text = re.sub(r' fast="(true|false)"', "", text)
    path.write_text(text)
    return path
