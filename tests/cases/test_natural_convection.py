"""Natural convection: pure conduction against its exact transfer, and a coarse run of the flow."""

import math

import pytest
from scipy.special import gamma

from particell.cases import natural_convection_results as results
from particell.cases.base import Context
from particell.cases.natural_convection import NaturalConvection
from particell.chemistry.species import Species
from particell.errors import InputError
from particell.materials import AVOGADRO, Fluid
from particell.schemes.static import Static
from particell.simulation import Simulation

#: Conformal radius of a square of side 1 about its centre: a circle of radius R there conducts
#: Q/(κΔC) = 2π/ln(radius/R), to O((R/side)^8).
CONFORMAL_RADIUS = 4 * math.sqrt(math.pi) / gamma(0.25) ** 2


def test_conduction_between_cylinder_and_box():
    """Resting particles: Q is 0.8 % too small with 40 particles a side, 0.4 % with 60."""
    case = NaturalConvection(resolution=40, end=1, averaging=0.5)
    exact = 0.5 * 2 * math.pi / math.log(CONFORMAL_RADIUS / 0.1)
    phases = case.phases(Fluid(density=1000.0, viscosity=1e-3))
    simulation = Simulation(
        case.domain,
        phases,
        Static(support=3.0),
        [Species("C", case.diffusivity)],
        boundaries=case.values(["C"], phases),
        normalise_diffusion=True,
    )
    time = case.length**2 / case.diffusivity
    run = simulation.run(0.3 * time, 0.1 * time, progress=False)
    _, cylinder, walls = results.transfers(case, run, "concentrations")
    assert cylinder[-1] == pytest.approx(exact, rel=0.01)
    assert walls[-1] == pytest.approx(cylinder[-1], rel=1e-3)
    inflow = run.field("inflow/C")[-1].sum()
    assert inflow == pytest.approx(run.observable("inflow_C")[-1], rel=1e-12)


@pytest.fixture(scope="module")
def coarse():
    case = NaturalConvection(resolution=24, end=15, averaging=3, molecules=200)
    simulation = case.build(Context(seed=1))
    return case, simulation, simulation.run(case.until, case.every, progress=False)


def test_coarse_flow(coarse):
    case, _, run = coarse
    metrics = results.metrics(case, run)
    assert metrics["vy_error"].value < 0.08
    assert metrics["C_error_concentrations"].value < 0.03
    for body in ("cylinder", "walls"):
        # 2.069; conduction alone would be 1.864
        assert metrics[f"transfer_{body}_concentrations"].value == pytest.approx(2.069, rel=0.08)
    assert abs(metrics["asymmetry"].value) < 2e-3
    assert metrics["drift_molecules"].value == 0
    assert abs(metrics["drift_concentrations"].value) < 1e-12
    assert metrics["density_variation"].value < 0.02


@pytest.mark.parametrize("carried", [False, True])
def test_a_transport_velocity_does_the_same(carried):
    case = NaturalConvection(
        resolution=24,
        end=8,
        averaging=2,
        molecules=50,
        scheme="transport-velocity",
        species_flux=carried,
    )
    simulation = case.build(Context(seed=1))
    run = simulation.run(case.until, case.every, progress=False)
    metrics = case.analyse(run, simulation)
    assert metrics["vy_error"].value < 0.1
    assert metrics["transfer_walls_concentrations"].value == pytest.approx(2.069, rel=0.1)
    for name in ("largest_void", "inside_walls", "drift_concentrations", "drift_molecules"):
        assert metrics[name].passed
    assert ("molecules' flux not met" in simulation.conservation()) == carried


def test_plain_particles_have_no_flux_of_species():
    with pytest.raises(InputError, match="species_flux"):
        NaturalConvection(species_flux=True).build(Context())


def test_the_fluid_rises_along_the_cylinder(coarse):
    case, _, run = coarse
    line = results.profile(case, run, "velocity")
    assert line.value[line.x < 0.7].min() > 0.03
    assert line.value[line.x > 0.85].max() < 0


def test_reflecting_surfaces_are_a_safeguard_only(coarse):
    _, simulation, _ = coarse
    assert "Reflect" in simulation.operations.by_name
    assert simulation.conservation()["reflections"] == 0


def test_molecules_follow_the_concentrations(coarse):
    """Poisson numbers about them; the total of 2.5e4, too, within 5 deviations (rate 6e-7)."""
    _, _, run = coarse
    score = results.poisson_score(run)
    assert score.passed and score.value > 0.5
    fluid = run.group("fluid")
    volume = run.static["mass"] / run.field("density")[-1]
    expected = (run.field("concentration/C")[-1] * volume * AVOGADRO)[fluid].sum()
    total = run.field("count/C_molecules")[-1][fluid].sum()
    assert expected > 2e4
    assert abs(total - expected) < 5 * math.sqrt(expected)
