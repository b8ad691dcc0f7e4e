"""Which form a sweep runs in: a fixed rule, so that the same description gives the same bits.

On a GPU there is one form. On CPUs lanes (:mod:`particell.compute.lanes`) evaluate two to three
times as many pairs as there are within the support, but gather nothing and use the whole vector.
"""

from __future__ import annotations

from particell.compute.dependence import Dependence
from particell.compute.plan import Plan

#: The part of the neighbour list that a form reads.
LISTS = {"gather": "rows", "lanes": "clusters", "cuda": "rows"}


def form_of(plan: Plan, backend: str, named: str | None = None) -> str:
    """The form of a plan on a backend.

    Parameters
    ----------
    plan
        Of the sweep.
    backend
        ``"cpu"`` or ``"cuda"``.
    named
        ``"gather"`` or ``"lanes"``: the form of all sweeps that it can be the form of.
    """
    if backend == "cuda":
        return "cuda"
    values = Dependence(plan)
    if named == "gather" or any(p.along_rows for p in plan.passes) or values.reads_along_rows():
        return "gather"
    return "lanes" if named == "lanes" or _suits_lanes(plan, values) else "gather"


def _suits_lanes(plan: Plan, values: Dependence) -> bool:
    """Whether lanes are the faster form: particles of one support, and pairs that cost little.

    Clusters are compact where spacings are alike. Random numbers, powers and the like cost more
    for the pairs that are evaluated in vain than gathering does.
    """
    if plan.dim == 1 or any(p.support is not None for p in plan.passes):
        return False
    return not any(values.is_dear(v) for roots in values.roots for vs in roots.values() for v in vs)
