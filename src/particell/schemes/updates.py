"""What integrators do to single particles: kicks, drifts, densities, equation of state."""

from __future__ import annotations

import math

from particell.compute.loop import particle_loop
from particell.laws.shifting import LARGEST
from particell.materials import pressure_of


@particle_loop
def kick(i, v, a, dt, *, DIM):
    """v += dt a."""
    for d in range(DIM):
        v[i, d] += dt * a[i, d]


@particle_loop
def drift(i, slides, x, transport, dt, *, DIM):
    """x += dt v, or dt (v + δv) with shifting; walls that slide keep their places."""
    if slides[i]:
        return
    for d in range(DIM):
        x[i, d] += dt * transport[i, d]


@particle_loop
def transport_velocity(i, is_wall, v, shift, mass, support, pressure, dt, transport, *, DIM):
    """v + δv, what moves particles (:mod:`particell.laws.shifting`), with P_s = ``pressure``."""
    factor = 0.0 if is_wall[i] else 0.5 * dt * pressure / mass[i]
    square = 0.0
    for d in range(DIM):
        square += shift[i, d] * shift[i, d]
    size = factor * math.sqrt(square) * dt
    limit = LARGEST * support[i]
    if size > limit:
        factor *= limit / size
    for d in range(DIM):
        transport[i, d] = v[i, d] + factor * shift[i, d]


@particle_loop
def fluid_volume(i, is_wall, mass, density, part):
    """The volume m/ρ of a mobile particle, 0 for walls."""
    part[i, 0] = 0.0 if is_wall[i] else mass[i] / density[i]


@particle_loop
def scale_density(i, is_wall, mass, density, volume, factor):
    """ρ ← ρ factor for mobile particles."""
    if not is_wall[i]:
        density[i] *= factor
        volume[i] = mass[i] / density[i]


@particle_loop
def equation_of_state(
    i,
    is_wall,
    group,
    mass,
    density,
    density_rate,
    dt,
    reference,
    sound_speed,
    exponent,
    background,
    density_sum,
    confinement,
    pressure,
    pressure_term,
    volume,
):
    """ρ += dt dρ/dt, then pressure, P/ρ² and volume; walls get their pressure from the fluid.

    With ρ summed the term is (P + P_c)/(s ρ²) (:mod:`particell.schemes.summation`), with
    ``density_sum`` s and ``confinement`` P_c.
    """
    if is_wall[i]:
        return
    rho = density[i] + dt * density_rate[i]
    g = group[i]
    p = pressure_of(rho, reference[g], sound_speed[g], exponent[g], background[g])
    density[i] = rho
    pressure[i] = p
    pressure_term[i] = (p + confinement[g]) / (rho * rho * density_sum[g])
    volume[i] = mass[i] / rho


@particle_loop
def predict_density(i, is_wall, mass, density, density_rate, half_step, density_half, volume):
    """Density and volume half a step on, by the last step's rate; walls keep theirs."""
    if is_wall[i]:
        density_half[i] = density[i]
        return
    rho = density[i] + half_step * density_rate[i]
    density_half[i] = rho
    volume[i] = mass[i] / rho


@particle_loop
def remember(i, x, v, density, a, density_rate, x0, v0, density0, a0, density_rate0, *, DIM):
    """Keep the state and its rates for the corrector of the trapezoidal rule."""
    for d in range(DIM):
        x0[i, d] = x[i, d]
        v0[i, d] = v[i, d]
        a0[i, d] = a[i, d]
    density0[i] = density[i]
    density_rate0[i] = density_rate[i]


@particle_loop
def predict(i, is_wall, slides, x, v, density, a, density_rate, dt, *, DIM):
    """The Euler predictor: x, v and ρ a step on with the rates at its beginning."""
    if slides[i]:
        return
    for d in range(DIM):
        x[i, d] += dt * v[i, d]
        v[i, d] += dt * a[i, d]
    if not is_wall[i]:
        density[i] += dt * density_rate[i]


@particle_loop
def correct(
    i,
    is_wall,
    slides,
    x,
    v,
    density,
    a,
    density_rate,
    x0,
    v0,
    density0,
    a0,
    density_rate0,
    dt,
    *,
    DIM,
):
    """The trapezoidal corrector: the mean of the rates at both ends of the step."""
    if slides[i]:
        return
    half = 0.5 * dt
    for d in range(DIM):
        x[i, d] = x0[i, d] + half * (v0[i, d] + v[i, d])
        v[i, d] = v0[i, d] + half * (a0[i, d] + a[i, d])
    if not is_wall[i]:
        density[i] = density0[i] + half * (density_rate0[i] + density_rate[i])
