"""Pictures in one style: maps, profiles against a reference, arrangements, series, histograms."""

from particell.plots.curves import curves, draw_series, expected_on, histogram, profile, time_series
from particell.plots.maps import arrangement, field_map, grid_map, mark_zone, within
from particell.plots.style import (
    COLOURS,
    MARKERS,
    STYLE,
    Picture,
    field_label,
    label,
    legend,
    new_figure,
    new_panels,
    save,
    styled,
)
from particell.units import length_scale, time_scale

__all__ = [
    "COLOURS",
    "MARKERS",
    "STYLE",
    "Picture",
    "arrangement",
    "curves",
    "draw_series",
    "expected_on",
    "field_label",
    "field_map",
    "grid_map",
    "histogram",
    "label",
    "legend",
    "length_scale",
    "mark_zone",
    "new_figure",
    "new_panels",
    "profile",
    "save",
    "styled",
    "time_scale",
    "time_series",
    "within",
]
