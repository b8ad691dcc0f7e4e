r"""Species that are molecules where there are few, and an amount where there are many.

A particle of more than ``switch_above`` molecules turns them into an amount; an amount worth fewer
than ``switch_below`` becomes whole molecules again. Between the two nothing changes.

*Conversion.* N molecules become N/(depth 𝒩) mol. An amount worth X molecules becomes X rounded at
random without bias; the remainder, less than one molecule's worth and of mean zero, stays in the
field ``amount`` of that particle, where it neither moves nor reacts until the particle holds an
amount again. So the sum of both kinds is constant to round-off.

*Diffusion.* Between two amounts the exchange is that of concentrations
(:mod:`particell.laws.diffusion`). Everything else is jumps (:mod:`particell.chemistry.jumps`): an
amount worth X sends out molecules to its neighbours that hold molecules as if it held X (rounded
at random) of them, and takes in those that arrive. With K = K_aa + K_m, the exchange between
amounts and all other jumps, the mean of a step is :math:`(1 + \tau K_{aa})\,e^{\tau K_m}` exactly.

*Reactions* whose species are all amounts in a particle are deterministic there, others are events
(:mod:`particell.chemistry.ssa`).

*Limits.* The deterministic part has no noise of its own: a number above the thresholds has the
variance of the molecules that it exchanges only. In a particle with molecules the frozen remainder
(less than one molecule's worth, of mean zero when it arises) is no part of the concentration.
"""

from __future__ import annotations

import numpy as np

from particell.chemistry.binomial import stochastic_round
from particell.compute.loop import particle_loop


@particle_loop
def switch_kind(
    i,
    s,
    column,
    above,
    below,
    step,
    quantum,
    key0,
    key1,
    id,
    group,
    status,
    continuous,
    count,
    amount,
):
    """Let species s of particle i (``column`` of the amounts) go over to the other kind."""
    if status[group[i], s] != 0:
        return
    if continuous[i, s] == 0:
        if count[i, s] > above:
            amount[i, column] += count[i, s] * quantum
            count[i, s] = 0
            continuous[i, s] = 1
    elif amount[i, column] < below * quantum:
        number = stochastic_round(
            amount[i, column] / quantum,
            np.uint64(id[i]),
            np.uint64(step),
            np.uint64(s),
            key0,
            key1,
        )
        amount[i, column] -= number * quantum
        count[i, s] = number
        continuous[i, s] = 0
