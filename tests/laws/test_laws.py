"""Every law at once: what is claimed of it (tests/claims.py) is proved, run, measured.

With symbols: that what is exchanged is, and that nothing depends on who looks. With quantities:
dimensions. With floats: what the generated loops give.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from numba import njit

from claims import CLAIMS, ELSEWHERE, EVERY, FIELDS, IDS, LAWS, ROOT
from cloud import FORMS, Cloud, Renamed, summed, width
from particell.compute.expressions import Vector, components, symbol
from particell.laws import Values, continuity, pair_of
from particell.laws.dimensions import SCALARS, VECTORS, check_units
from particell.laws.fluctuations import ThermalNoise, pair_numbers
from particell.laws.species_flux import species_flux
from particell.laws.viscosity import Viscosity
from particell.units import registry

PROFILE = np.linspace(1.0, 0.0, 41)
every_law = pytest.mark.parametrize(("law", "claim"), EVERY, ids=IDS)


def test_no_law_is_forgotten():
    known = {*CLAIMS, *ELSEWHERE}
    missing = [f"'{n}': [Claim(...)] in CLAIMS of tests/claims.py" for n in {*LAWS} - known]
    assert not missing, f"say what they claim: {', '.join(missing)}"
    assert not known - {*LAWS}, "claims of laws that there are no longer"
    assert all((ROOT / page).is_file() for page in ELSEWHERE.values())


# --- symbols -----------------------------------------------------------------------------------
def symbols(side):
    """A particle whose values are symbols, in two dimensions; density is mass over volume."""
    names = (*SCALARS, *FIELDS)
    values = {name: sympy.Symbol(f"{name}_{side}", positive=True) for name in names}
    for name in ("inverse_dt", "time", "equation", "fluid", "diffusion"):  # both are of one fluid
        values[name] = sympy.Symbol(name, positive=True)
    for name in VECTORS:
        parts = [sympy.Symbol(f"{name}{axis}_{side}", real=True) for axis in "xy"]
        values[name] = Vector.of(name, parts)
    values["gravity"] = Vector.of("gravity", sympy.symbols("gx gy", real=True))
    density = values["mass"] / values["volume"]
    values |= {"density": density, "specific_volume": 1 / density, "profile": PROFILE}
    return Values(dim=2, **values)


def both_ends(i, j, **more):
    """The pair as i and as j see it; numbers of a noise change sign, and r is a symbol."""
    kernel = {"F": sympy.Symbol("F", positive=True), "W": sympy.Symbol("W", positive=True)}
    numbers = [sympy.Symbol(f"xi_{axis}", real=True) for axis in "xy"]
    r = sympy.Symbol("r", positive=True)
    found = []
    for first, second, sign in ((i, j, 1), (j, i, -1)):
        noise = Vector.of("noise", [sign * n for n in numbers])
        apart = [p - q for p, q in zip(first.x.parts(2), second.x.parts(2), strict=True)]
        x = Vector.of("x", apart)
        own = {"r": r, "square": r**2, "x": x, "e": (1 / r) * x, "missed": sympy.Symbol("q")}
        own |= {"noise": lambda _, noise=noise: noise, **more}
        found.append(pair_of(first, second, **{**kernel, **own}))
    return found


def plain(vector):
    """The symbols that a vector is made of."""
    (base,) = vector.terms
    return base.parts


def flat(adds):
    """All components that a law adds, by name."""
    return [(name, part) for name, value in adds.items() for part in components(value, 2)]


def vanishes(value, repels=False):
    """Whether an expression is zero."""
    value = sympy.sympify(value)
    if value.is_zero:
        return True
    if repels:
        value = value.replace(lambda e: isinstance(e, sympy.Piecewise), lambda e: e.args[0].expr)
    return bool(sympy.simplify(value).is_zero)


def exchange(law, name, weight):
    """What a pair makes of a sum over all particles, component by component."""
    i, j = symbols("i"), symbols("j")
    ij, ji = both_ends(i, j)
    ends = zip(
        components(law.pair(i, j, ij)[name], 2),
        components(law.pair(j, i, ji)[name], 2),
        strict=True,
    )
    weights = [getattr(p, weight) if weight else 1 for p in (i, j)]
    return [weights[0] * a + weights[1] * b for a, b in ends]


@every_law
def test_what_is_exchanged_is_conserved(law, claim):
    """Momentum, amounts, heat: proved, for any values of two particles. And no more is claimed."""
    for name, weight in claim.exchanged.items():
        assert all(vanishes(part, claim.repels) for part in exchange(law, name, weight))
    i, j, ij = numbers(2)
    adds = law.pair(i, j, ij)
    back = law.pair(j, i, pair_of(j, i, ij.F, ij.W, noise=lambda _: -1.0 * ij.noise(True)))
    for name in set(adds) - set(law.own) - set(claim.exchanged):
        for weight in ("mass", "volume", ""):
            own, its = (getattr(p, weight) if weight else 1.0 for p in (i, j))
            ends = [components(found[name], 2) for found in (adds, back)]
            total = [own * a + its * b for a, b in zip(*ends, strict=True)]
            assert max(np.abs(total)) > 1e-9, f"{name} times {weight or 1} is conserved: claim it"


def test_what_shifts_carry_of_species_is_conserved():
    law = LAWS["PairShifts"]()
    i, j = symbols("i"), symbols("j")
    contents = sympy.symbols("C_i C_j")
    ends = [law.pair(*pair) for pair in zip((i, j), (j, i), both_ends(i, j), strict=True)]
    gains = [
        species_flux.py_func(end["own_shift"], end["its_shift"], *content)
        for end, content in zip(ends, (contents, contents[::-1]), strict=True)
    ]
    assert vanishes(sum(gains)) and not vanishes(gains[0])


def seen_from(law, claim, **moved):
    """What a law gives of one pair, and of the same with vectors to which something is added."""
    i, j = symbols("i"), symbols("j")
    found = []
    for pair in ((i, j), [p.replace(**{k: q(getattr(p, k)) for k, q in moved.items()})
                          for p in (i, j)]):  # fmt: skip
        inside, _ = both_ends(*pair)
        grow = sympy.Symbol("s", positive=True)
        beside, _ = both_ends(*pair, wall=True, extrapolation=grow, v=grow * inside.v)
        found.append(flat(summed(law, pair[0], [(pair[1], inside), (pair[1], beside)])))
    return [(name, a - b) for (name, a), (_, b) in zip(*found, strict=True)]


def added(name):
    """A vector to which one of symbols is added."""
    more = sympy.symbols(f"{name}_0 {name}_1", real=True)
    return lambda old: Vector.of("moved", [p + q for p, q in zip(old.parts(2), more, strict=True)])


@every_law
def test_nothing_depends_on_who_looks(law, claim):
    """The same for particles that all move faster, and for the same ones elsewhere: as claimed."""
    faster = seen_from(law, claim, v=added("V"))
    assert all(vanishes(part) for _, part in faster) is claim.galilean
    elsewhere = seen_from(law, claim, x=added("X"))
    assert all(vanishes(part) for _, part in elsewhere) is claim.anywhere


# --- friction and noise ------------------------------------------------------------------------
FRICTIONS = [
    pytest.param(law, claim, id=name)
    for (law, claim), name in zip(EVERY, IDS, strict=True)
    if claim.balance and not isinstance(claim.balance, str)
]


@every_law
def test_every_friction_has_a_noise_or_says_why_not(law, claim):
    i, j = symbols("i"), symbols("j")
    ij, _ = both_ends(i, j)
    forces = [n for n, unit in claim.units.items() if unit == "m/s^2"]
    speeds = set(plain(i.v))
    adds = [p for name, p in flat(law.pair(i, j, ij)) if name in forces or name == "drag"]
    held = any(sympy.sympify(part).free_symbols & speeds for part in adds)
    assert held == bool(claim.balance)


def exact(value):
    """An expression without floats: √2 is one that SymPy took the value of."""
    return value.replace(
        lambda e: e.is_Float, lambda e: sympy.nsimplify(e, [sympy.sqrt(2)], tolerance=1e-12)
    )


beside = pytest.mark.parametrize("wall", [False, True], ids=["fluid", "wall"])


@beside
@pytest.mark.parametrize(("law", "claim"), FRICTIONS)
def test_noise_balances_friction(law, claim, wall):
    """⟨F F⟩ Δt = 2 k_BT times the friction, component by component; with walls as grown."""
    i, j = symbols("i"), symbols("j")
    j = j.replace(**{name: getattr(i, name) for name in ("transverse", "radial", "thermal")})
    angle = sympy.Symbol("theta", real=True)
    more = {"e": Vector.of("e", [sympy.cos(angle), sympy.sin(angle)])}
    if wall:
        grow = sympy.Symbol("s", positive=True)
        apart = [p - q for p, q in zip(plain(i.v), plain(j.v), strict=True)]
        more |= {"wall": True, "extrapolation": grow, "v": grow * Vector.of("v", apart)}
    ij, _ = both_ends(i, j, **more)
    noise, drag = (
        [exact(part) for part in components(found["a"], 2)]
        for found in (claim.balance.pair(i, j, ij), law.pair(i, j, ij))
    )
    drawn, speeds = sympy.symbols("xi_x xi_y", real=True), plain(i.v)
    for p in range(2):
        for q in range(2):
            ends = [(sympy.diff(noise[p], n), sympy.diff(noise[q], n)) for n in drawn]
            friction = -sympy.diff(drag[p], speeds[q])
            expected = 2 * i.thermal * friction / i.mass * i.inverse_dt
            difference = sympy.expand(sum(one * other for one, other in ends) - expected)
            assert sympy.simplify(sympy.trigsimp(difference)) == 0
            assert friction != 0 or p != q


def matrix_of(law, i, j, pair, dim):
    """Minus the acceleration by a unit of velocity, or of noise, along each axis."""
    columns = []
    for axis in range(dim):
        unit = Vector.of("unit", [float(d == axis) for d in range(dim)])
        more = {"v": pair.extrapolation * unit, "noise": lambda _, unit=unit: unit}
        columns.append(components(law.pair(i, j, pair.replace(**more))["a"], dim))
    return -np.array(columns, float).T


@beside
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize(("law", "claim"), FRICTIONS)
def test_noise_balances_friction_of_two_materials(law, claim, dim, wall):
    """The same on floats, for coefficients and temperatures that differ; k_BT is the pair's."""
    i, j, pair = numbers(dim)
    if wall:
        j = j.replace(transverse=i.transverse, radial=i.radial)

    pair = pair.replace(extrapolation=1.7, wall=True) if wall else pair
    friction = matrix_of(law, i, j, pair, dim)
    noise = matrix_of(claim.balance, i, j, pair, dim)
    thermal = 2 / (1 / i.thermal + 1 / j.thermal)
    expected = 2 * thermal * i.inverse_dt / i.mass * friction
    np.testing.assert_allclose(noise @ noise.T, expected, atol=1e-13 * expected.max())
    assert np.linalg.eigvalsh(friction).min() > 0.0


@njit
def drawn(number, steps, gaussian, back, dim, found):
    """The numbers of pairs (k, k + number) in some steps, or of (k + number, k)."""
    for k in range(number):
        i, j = (k + number, k) if back else (k, k + number)
        for step in range(steps):
            values = pair_numbers(i, j, step, 12345, 678, gaussian, dim)
            for axis in range(3):
                found[axis, k * steps + step] = values[axis]


@beside
@pytest.mark.parametrize("gaussian", [False, True], ids=["bounded", "gaussian"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_noise_balances_friction_in_samples(dim, gaussian, wall):
    """⟨F F⟩ Δt/2k_BT is Γ and ⟨F⟩ is zero, for the numbers that the loops draw; F_ij = −F_ji.

    Two materials and temperatures, or a wall. Within 6 standard errors: 60 numbers are compared,
    P(|z| > 6) = 2e-9, so a false alarm has a probability of 1e-7.
    """
    friction, number, steps = Viscosity(True), 2000, 100
    i, j, pair = numbers(dim)
    if wall:
        j = j.replace(transverse=i.transverse, radial=i.radial)
        pair = pair.replace(extrapolation=1.7, wall=True)
    forces = []
    for back in (False, True):
        found = np.empty((3, number * steps))
        drawn(number, steps, gaussian, back, dim, found)
        noise = Vector.of("noise", found[:dim])
        given = pair.replace(noise=lambda _, noise=noise: noise)
        adds = ThermalNoise(friction, gaussian).pair(i, j, given)
        forces.append(np.array(components(adds["a"], dim)))
    thermal = 2 / (1 / i.thermal + 1 / j.thermal)
    exact = 2 * thermal * i.inverse_dt / i.mass * matrix_of(friction, i, j, pair, dim)
    sample = forces[0] @ forces[0].T / (number * steps)
    diagonal = np.diag(exact)
    spread = np.sqrt((np.outer(diagonal, diagonal) + exact**2) / (number * steps))
    assert (np.abs(sample - exact) < 6 * spread).all()
    assert (np.abs(forces[0].mean(axis=1)) < 6 * np.sqrt(diagonal / (number * steps))).all()
    assert (forces[0] == -forces[1]).all()


# --- quantities --------------------------------------------------------------------------------
@every_law
def test_dimensions(law, claim, monkeypatch):
    """What is added has the unit claimed, also where sums are finished; in three dimensions."""
    monkeypatch.setattr(continuity, "compressibility", continuity.compressibility.py_func)
    dim = claim.dims[-1]
    found = check_units(law, dim, FIELDS, **claim.numbers)
    assert set(found) == set(claim.units)
    for name, unit in found.items():
        assert registry()(unit).check(registry()(claim.units[name] or "1")), name


# --- floats ------------------------------------------------------------------------------------
def values_of(dim, n, random):
    """Fields of n particles in units of one."""
    scalars = {name: random.uniform(1.0, 2.0, n) for name in (*SCALARS, *FIELDS)}
    del scalars["specific_volume"]  # which is derived
    for name in ("equation", "fluid", "by_fraction"):
        scalars[name] = random.integers(0, 2, n).astype(float)
    scalars["support"] = np.where(np.arange(n) % 2, 3.0, 0.75)
    scalars |= {"grow": random.uniform(0, 1, n), "gap": random.uniform(0, 0.5, n)}
    vectors = {name: random.uniform(-1, 1, (n, dim)) for name in VECTORS}
    return scalars, vectors


def numbers(dim):
    """Two particles and their pair, as floats."""
    cloud = cloud_of(dim, 4)
    i, j = cloud.particle(0), cloud.particle(1)
    near = [p + 0.1 * (k + 1) for k, p in enumerate(i.x.parts(dim))]
    j = j.replace(x=Vector.of("x", near))
    noise = Vector.of("noise", np.random.default_rng(2).normal(size=dim).tolist())
    return i, j, pair_of(i, j, 0.7, 0.9, noise=lambda _: noise)


def cloud_of(dim, n, near=1.2):
    """Particles of two supports; the finer ones stand where they have neighbours."""
    random = np.random.default_rng(3)
    scalars, vectors = values_of(dim, n, random)
    vectors["x"] = random.normal(3.5, near, (n, dim)) % 7.0
    fine = scalars["support"] < 1.0
    vectors["x"][fine] = random.normal(0.1, 0.3, (fine.sum(), dim)) % 7.0  # around a corner
    vectors["x"][~fine][: n // 8] = 0.3
    return Cloud(dim, n, scalars, vectors, {"profile": PROFILE})


def derived():
    return {
        "specific_volume": lambda p: p.volume / p.mass,
        "profile": lambda _: symbol("array", "profile"),
    }


def named(dim, once=False):
    """All laws that there are in so many dimensions, by names apart; or only one of each class."""
    found, seen = [], set()
    for k, (law, claim) in enumerate(EVERY):
        if dim in claim.dims and not (once and type(law) in seen):
            found.append(Renamed(law, k))
            seen.add(type(law))
    return found


@pytest.fixture(scope="module", params=[1, 2, 3], ids=["1D", "2D", "3D"])
def by_hand(request):
    """A cloud, and what all laws give run on floats."""
    dim = request.param
    cloud = cloud_of(dim, {1: 32, 2: 80, 3: 80}[dim])
    found = cloud.by_hand(named(dim))
    sums = {}
    for name in {name: None for every in found for adds in every for name in adds}:
        rows = [next(adds[name] for adds in every if name in adds) for every in found]
        sums[name] = (width(rows[0], dim), np.array([components(v, dim) for v in rows], float))
    return cloud, sums


def check(laws, cloud, sums, run, form):
    """Loops against what was found by hand."""
    prefixes = tuple(law.mark for law in laws)
    sums = {name: value for name, value in sums.items() if name.startswith(prefixes)}
    results = {name: columns for name, (columns, _) in sums.items()}
    found = run(cloud.sweep(laws, results, derived()), results, form)
    for name, (columns, values) in sums.items():
        got = found[name] if columns else found[name][:, None]
        scale = np.abs(values).max()
        assert np.isfinite(scale), name
        np.testing.assert_allclose(got, values, rtol=0, atol=1e-12 * scale, err_msg=name)
        assert scale > 0 or name.endswith("_flux"), name


@pytest.mark.parametrize("form", FORMS)
def test_loops_say_what_laws_say(by_hand, form):
    """All laws in one loop, over fluid and walls, of supports of 4:1, as Python reads its text.

    Rows have all particles there are: what is beyond a pair's support adds nothing.
    """
    cloud, sums = by_hand
    check(named(cloud.dim), cloud, sums, cloud.read, form)


def test_loops_do_what_laws_say(by_hand):
    """One of each class, compiled, in two dimensions."""
    cloud, sums = by_hand
    if cloud.dim == 2:
        check(named(2, once=True), cloud, sums, cloud.run, "gather")


@every_law
def test_nothing_comes_from_beyond_the_support(law, claim):
    """Where the kernel is zero a law adds nothing, for any values: also beside a wall."""
    for dim in claim.dims:
        i, j, pair = numbers(dim)
        unit = pair.noise
        away = [10.0 * float(d == 0) for d in range(dim)]
        far = j.replace(x=Vector.of("x", away))
        for wall in (False, True):
            more = {"wall": wall, "extrapolation": 1.5, "missed": 0.1, "noise": unit}
            for value in law.pair(i, far, pair_of(i, far, 0.0, 0.0, **more)).values():
                assert not np.any(components(value, dim))
