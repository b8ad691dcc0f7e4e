"""Where a rate that is not finite comes from: the field and the particle to name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from particell.compute.device import Device

#: What the rates of exchange are made of, in the order in which one field spoils the next.
MADE_OF = ("x", "support", "mass", "density", "volume")


def origin(device: Device, fields: Mapping[str, Any], rates: Any) -> tuple[str, int]:
    """The field and the row of the particle that made ``rates`` (n,) not finite.

    A particle whose own fields are broken spoils the rates of all its neighbours: it is named, not
    the first of those. Where all fields are finite it is the first particle whose rate is not.
    """
    for name in MADE_OF:
        values = device.to_host(fields[name])
        bad = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        if bad.any():
            return name, int(np.argmax(bad))
    return "x", int(np.argmin(np.isfinite(device.to_host(rates))))
