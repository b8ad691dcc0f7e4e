"""Figures of a fluctuating fluid at rest: structure factor, answers to kicks, pressure.

Numbers are without units: lengths in h, times in h²ρ/η, pressures in ρ c₀².
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from particell import plots
from particell.analysis.statistics import Moments


class Mode(NamedTuple):
    """Waves of one length, each of the longitudinal and the transverse ones.

    ``kh`` is k h; ``found`` are the answers to kicks (kicks, moments), and ``exact`` those asked
    for, (n,).
    """

    kh: float
    found: Sequence[np.ndarray]
    exact: Sequence[np.ndarray]


@plots.styled
def structure(kh2: np.ndarray, measured: Moments, fine: np.ndarray, asked: Sequence[float]):
    """S(k) over that of long waves, at (k h)²."""
    figure, axes = plots.new_figure()
    axes.errorbar(kh2, measured.mean, measured.error, fmt="o", mfc="none", label="particles")
    axes.plot(fine, asked, "-", label="asked for, as the kernel shows it")
    axes.set(xlabel="(k h)²", ylabel="S(k) m c₀² / k_BT", ylim=(0, None))
    plots.legend(axes, loc="lower right")
    return figure


@plots.styled
def modes(time: np.ndarray, fine: np.ndarray, waves: Sequence[Mode]):
    """Answers to kicks at moments, and the exact ones at finer times."""
    figure, (left, right) = plots.new_figure(7.0, 3.0, columns=2)
    for wave, colour, mark in zip(waves, plots.COLOURS, "os", strict=False):
        for axes, found, exact in zip((right, left), wave.found, wave.exact, strict=True):
            error = found.std(axis=0, ddof=1) / math.sqrt(len(found))
            axes.plot(fine, exact, "-", color=colour, linewidth=1)
            axes.errorbar(
                time,
                found.mean(axis=0),
                error,
                fmt=mark,
                color=colour,
                mfc="none",
                markersize=4,
                label=f"k h = {wave.kh:.2f}",
            )
    left.set(xlabel="t η / (ρ h²)", ylabel="answer to a kick", yscale="log", title="transverse")
    right.set(xlabel="t η / (ρ h²)", title="longitudinal")
    plots.legend(left)
    return figure


@plots.styled
def pressure(times: np.ndarray, values: np.ndarray, mean: Moments):
    """Pressure of frames, with its mean."""
    figure, axes = plots.new_figure(5.2, 3.0)
    axes.plot(times, 100 * values, ".", markersize=2)
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set(xlabel="t η / (ρ h²)", ylabel="virial pressure [% of ρ c₀²]")
    axes.set_title(f"mean {100 * float(mean.mean):.3f} ± {100 * float(mean.error):.3f} %")
    return figure
