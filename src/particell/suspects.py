"""Which laws of the user's may have broken a field: what messages of broken runs name."""

from __future__ import annotations

from particell.compute.sweep import Sweep
from particell.errors import InputError
from particell.fields import RATE
from particell.laws.law import Law, Values
from particell.limits import Mobile, law_limits
from particell.schemes.flow import Flow
from particell.sources.source import Side

#: Fields that accelerations bring about, as messages call them.
MOVED = ("a", "v", "x", "position", "density", "density_rate", "pressure", "pressure_term")


def suspects(flow: Flow, field: str) -> str:
    """What is said of laws of the user's where a field is broken; nothing where there are none."""
    laws, dt = flow.laws, flow.state.dt
    if not laws:
        return ""
    forces = flow.sweeps().forces()
    own = [f.name for f in flow.scheme.fields]
    adds = {type(law).__name__: names_added(law, forces) for law in laws}
    if field.removesuffix(RATE) in own:
        rate = field.removesuffix(RATE) + RATE
        text = f" (only laws of your own change it: {_listed(adds, rate)})"
    elif field in MOVED:
        moved = _listed(adds, "a")
        text = f" (besides the scheme's, laws of your own act on it: {moved})" if moved else ""
    else:
        return ""
    try:
        allowed = law_limits(laws, Mobile(flow))
    except InputError:  # of what is broken they say nothing
        allowed = {}
    late = [f"{name} allows {step:.3g} s" for name, step in allowed.items() if step < dt]
    return f"{text} at dt = {dt:.3g} s, of which {', '.join(late)}" if late else text


def _listed(adds: dict[str, set[str]], name: str) -> str:
    return ", ".join(law for law, names in adds.items() if name in names)


def names_added(law: Law, sweep: Sweep) -> set[str]:
    """The names of what a law adds to in a sweep."""
    me, sums, names = Side(sweep.names, "i"), dict.fromkeys(law.own, 0.0), set()
    for source in sweep.sources:
        found = law.pair(*source.see(me, Side(sweep.names, "j"), sweep.kernel, sweep.uniform))
        names |= set(found)
        sums |= {name: value for name, value in found.items() if name in law.own}
    return (names | set(law.finish(me, Values(**sums)))) - set(law.own)
