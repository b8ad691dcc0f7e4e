"""Many realisations of one description: run them, and take statistics over them."""

from particell.ensemble.ensemble import (
    Ensemble,
    EnsembleInterrupted,
    is_ensemble,
    realisation_seed,
)
from particell.ensemble.results import EnsembleRun

__all__ = ["Ensemble", "EnsembleInterrupted", "EnsembleRun", "is_ensemble", "realisation_seed"]
