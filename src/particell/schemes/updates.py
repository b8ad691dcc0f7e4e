"""What integrators do to single particles: kicks, drifts, densities, equation of state."""

from __future__ import annotations

import math

from numba import njit

from particell.boundaries.wall_friction import slowed
from particell.compute.loop import particle_loop
from particell.laws.shifting import LARGEST
from particell.materials import pressure_of


@njit(inline="always")
def push(i, v, a, wall_friction, s, dt, DIM, HELD):
    """v += dt a, beside walls (``HELD``) dt (I + s Γ)⁻¹ a."""
    if HELD:
        ay = a[i, 1] if DIM > 1 else 0.0
        az = a[i, 2] if DIM > 2 else 0.0
        ax, ay, az = slowed(i, wall_friction, s, a[i, 0], ay, az, DIM, HELD)
        v[i, 0] += dt * ax
        if DIM > 1:
            v[i, 1] += dt * ay
        if DIM > 2:
            v[i, 2] += dt * az
    else:
        for d in range(DIM):
            v[i, d] += dt * a[i, d]


@particle_loop
def kick(i, v, a, wall_friction, dt, *, DIM, HELD):
    """v += dt a, beside walls (``HELD``) dt (I + dt Γ)⁻¹ a: dt is half a step."""
    push(i, v, a, wall_friction, dt, dt, DIM, HELD)


@particle_loop
def change(i, is_wall, value, rate, dt, *, COLUMNS):
    """A field after dt by its rate; walls keep theirs."""
    if is_wall[i]:
        return
    if COLUMNS:
        for d in range(COLUMNS):
            value[i, d] += dt * rate[i, d]
    else:
        value[i] += dt * rate[i]


@particle_loop
def drift(i, slides, x, transport, dt, *, DIM):
    """x += dt v, or dt (v + δv) with shifting; walls that slide keep their places."""
    if slides[i]:
        return
    for d in range(DIM):
        x[i, d] += dt * transport[i, d]


@particle_loop
def transport_velocity(
    i,
    is_wall,
    group,
    v,
    shift,
    mass,
    support,
    shift_pressure,
    shift_sound,
    shift_friction,
    shift_before,
    flux,
    transport,
    dt,
    *,
    DIM,
    FLUX,
):
    """v + δv in the middle of a step, what moves particles; tables are by group.

    δv is that of :mod:`particell.laws.shifting`. It is known where the step begins, and from there
    it goes on by half of what it has changed by in the step before: of second order, where the step
    is half of the shift's τ or less, and less of that where it is longer, since what goes on by all
    of it is stable for half as long a step. Half a step of the last ``FLUX`` of momentum brings v
    to the middle.
    """
    h, g = support[i], group[i]
    time = min(shift_sound[g] * h, shift_friction[g] * h * h)
    factor = 0.0 if is_wall[i] else 0.5 * time * shift_pressure[g] / mass[i]
    ahead = 0.5 * min(1.0, max(0.0, time / dt - 1.0))
    square = 0.0
    for d in range(DIM):
        transport[i, d] = shift[i, d] + ahead * (shift[i, d] - shift_before[i, d])
        shift_before[i, d] = shift[i, d]
        square += transport[i, d] * transport[i, d]
    size = factor * math.sqrt(square) * time
    limit = LARGEST * h
    if size > limit:
        factor *= limit / size
    for d in range(DIM):
        transport[i, d] = v[i, d] + factor * transport[i, d]
        if FLUX:
            transport[i, d] += 0.5 * dt * flux[i, d]


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
def predict(i, is_wall, slides, x, v, density, a, density_rate, wall_friction, dt, *, DIM, HELD):
    """The Euler predictor: x, v and ρ a step on with the rates at its beginning.

    Beside walls (``HELD``) it is the velocity's implicit midpoint rule, as in a :func:`kick`.
    """
    if slides[i]:
        return
    for d in range(DIM):
        x[i, d] += dt * v[i, d]
    push(i, v, a, wall_friction, 0.5 * dt, dt, DIM, HELD)
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
    wall_friction,
    dt,
    *,
    DIM,
    HELD,
):
    """The trapezoidal corrector: the mean of the rates at both ends of the step.

    Beside walls (``HELD``) the friction with them, which a holds at the predicted velocity, is
    made implicit: (I + ½dt Γ)(v − v0) = ½dt (a0 + a + dt Γ w) with the predictor's w = (v − v0)/dt,
    that is v = v0 + ½dt (3w + M(a − 2w)) where Γ is the same at both ends.
    """
    if slides[i]:
        return
    half = 0.5 * dt
    for d in range(DIM):
        x[i, d] = x0[i, d] + half * (v0[i, d] + v[i, d])
    if HELD:
        inverse = 1.0 / dt
        wx = (v[i, 0] - v0[i, 0]) * inverse
        wy = (v[i, 1] - v0[i, 1]) * inverse if DIM > 1 else 0.0
        wz = (v[i, 2] - v0[i, 2]) * inverse if DIM > 2 else 0.0
        ay = a[i, 1] - 2.0 * wy if DIM > 1 else 0.0
        az = a[i, 2] - 2.0 * wz if DIM > 2 else 0.0
        ax = a[i, 0] - 2.0 * wx
        ax, ay, az = slowed(i, wall_friction, half, ax, ay, az, DIM, HELD)
        v[i, 0] = v0[i, 0] + half * (3.0 * wx + ax)
        if DIM > 1:
            v[i, 1] = v0[i, 1] + half * (3.0 * wy + ay)
        if DIM > 2:
            v[i, 2] = v0[i, 2] + half * (3.0 * wz + az)
    else:
        for d in range(DIM):
            v[i, d] = v0[i, d] + half * (a0[i, d] + a[i, d])
    if not is_wall[i]:
        density[i] = density0[i] + half * (density_rate0[i] + density_rate[i])
