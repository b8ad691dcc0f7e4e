"""Which sources are mutated, and which tests are to notice."""

from __future__ import annotations

PACKAGE = "src/particell/"
#: What is mutated: laws, boundaries, chemistry, checkpoints and restart.
SOURCES = (
    "laws",
    "boundaries",
    "chemistry",
    "restart.py",
    "restored.py",
    "output/checkpoint.py",
)
#: Files that write equations and remarks for people.
TEXT = ("laws/equation.py", "chemistry/remarks.py", "chemistry/listing.py")
#: Where conditions for refusing are mutated too, as it is what the file is for.
REFUSING = ("restored.py", "output/checkpoint.py", "restart.py")
#: Tests of a file by the beginning of its path (the longest that fits), quick ones first.
TESTS = {
    "laws/": "laws/test_laws.py laws/test_images.py laws/test_sweeps.py schemes/test_sdpd.py",
    "laws/body_force": "laws/test_body_force.py laws/test_laws.py",
    "laws/buoyancy": "laws/test_buoyancy.py laws/test_laws.py",
    "laws/carriers": "chemistry/test_exchange.py chemistry/test_transport.py",
    "laws/continuity": "laws/test_images.py laws/test_sweeps.py laws/test_continuity.py",
    "laws/diffusion": "chemistry/test_exchange.py chemistry/test_flux_walls.py "
    "chemistry/test_transport.py",
    "laws/digest": "laws/test_digest.py",
    "laws/dimensions": "laws/test_laws.py schemes/test_listing.py",
    "laws/hydrostatics": "physics/test_hydrostatic_rest.py",
    "laws/shifting": "laws/test_shifting.py laws/test_images.py laws/test_transport_velocity.py",
    "laws/species_flux": "laws/test_laws.py laws/test_species_flux.py",
    "laws/tensors": "laws/test_tensors.py chemistry/test_exchange.py",
    "laws/transport_velocity": "laws/test_images.py laws/test_transport_velocity.py",
    "laws/wall_pressure": "laws/test_images.py boundaries/test_wall.py",
    "boundaries/impenetrable": "boundaries/test_impenetrable.py",
    "boundaries/mean_velocity": "boundaries/test_mean_velocity.py",
    "boundaries/mirror": "boundaries/test_mirror.py",
    "boundaries/moving": "boundaries/test_moving.py",
    "boundaries/reflection": "boundaries/test_reflection.py test_simulation.py",
    "boundaries/sponge": "boundaries/test_sponge.py test_simulation.py",
    "boundaries/volume_fraction": "boundaries/test_volume_fraction.py",
    "boundaries/wall": "boundaries/test_wall.py boundaries/test_moving.py",
    "boundaries/wall_friction": "boundaries/test_wall_friction.py",
    "chemistry/": "chemistry/test_species_reactions.py chemistry/test_reactions_in_particles.py "
    "chemistry/test_mixed_reactions.py chemistry/test_coupling.py chemistry/test_transport.py",
    "chemistry/binomial": "chemistry/test_binomial.py chemistry/test_crossings.py",
    "chemistry/contents": "chemistry/test_contents.py",
    "chemistry/crossings": "chemistry/test_crossings.py",
    "chemistry/diffusion": "chemistry/test_exchange.py chemistry/test_flux_walls.py "
    "chemistry/test_transport.py",
    "chemistry/exchange": "chemistry/test_exchange.py chemistry/test_flux_walls.py",
    "chemistry/fluxes": "chemistry/test_flux_walls.py",
    "chemistry/formula": "chemistry/test_lawcode.py chemistry/test_species_reactions.py",
    "chemistry/hybrid": "chemistry/test_mixed_reactions.py chemistry/test_coupling.py "
    "chemistry/test_running_out.py",
    "chemistry/integrators": "chemistry/test_error_control.py "
    "chemistry/test_reactions_in_particles.py chemistry/test_species_reactions.py",
    "chemistry/joint": "chemistry/test_mixed_reactions.py chemistry/test_coupling.py "
    "chemistry/test_running_out.py",
    "chemistry/jumprates": "chemistry/test_exchange.py chemistry/test_flux_walls.py "
    "chemistry/test_transport.py",
    "chemistry/jumps": "chemistry/test_binomial.py chemistry/test_exchange.py "
    "chemistry/test_transport.py",
    "chemistry/lawcode": "chemistry/test_lawcode.py",
    "chemistry/polynomials": "chemistry/test_lawcode.py",
    "chemistry/rates": "chemistry/test_error_control.py "
    "chemistry/test_reactions_in_particles.py chemistry/test_mixed_reactions.py",
    "chemistry/reservoirs": "chemistry/test_flux_walls.py chemistry/test_transport.py",
    "chemistry/sbml": "chemistry/test_sbml_core.py chemistry/test_sbml.py",
    "chemistry/ssa": "chemistry/test_reactions_in_particles.py chemistry/test_splitting.py "
    "chemistry/test_dsmts.py",
    "chemistry/switching": "chemistry/test_switching.py",
    "chemistry/walks": "chemistry/test_exchange.py chemistry/test_transport.py",
    "output/checkpoint": "output/test_checkpoint.py",
    "restart": "test_restored_states.py test_simulation.py",
    "restored": "test_restored_states.py",
}


def tests_of(file: str) -> list[str]:
    """The test files for a source file."""
    name = file.removeprefix(PACKAGE)
    fitting = [prefix for prefix in TESTS if name.startswith(prefix)]
    return [f"tests/{t}" for t in TESTS[max(fitting, key=len)].split()]
