"""Tests that ``make test`` leaves out and ``make test-long`` runs, by how their names begin.

Each is a variant of what another test looks at (another dimension, scheme, kernel), has loops of
its own to compile, and takes from eight to forty seconds for that.
"""

IN_SPACE = [
    f"{drift}-{advance}-{scheme}"
    for drift in (0.0, 0.7)
    for advance in (0.01, 0.1, 0.25, 0.5)
    for scheme in ("sdpd", "transport velocity")
]
LONG = (
    "tests/cases/test_annihilation_1d.py::test_a_run_to_the_steady_state",
    "tests/physics/test_hydrostatic_rest.py::test_where_a_dissolved_species_is_what_weighs[Transport",
    "tests/boundaries/test_impenetrable.py::test_nothing_is_ever_inside_walls_at_rest[slab-Transport",
    "tests/boundaries/test_impenetrable.py::test_nothing_is_ever_inside_walls_that_move_in_space[plate",
    "tests/boundaries/test_mirror.py::test_the_profile_of_half_a_channel",
    "tests/boundaries/test_volume_fraction.py::test_bounce_back_from_a_wall_that_accelerates[3]",
    "tests/boundaries/test_wall.py::test_friction_beside_a_plane_is_exact_for_a_parabola[3-normal",
    "tests/boundaries/test_wall_friction.py::test_equipartition_is_exact_beside_walls_whatever_the"
    "_step[3-",
    "tests/cases/test_drag_array.py::test_drag_is_right[sphere 3 transport-velocity",
    "tests/cases/test_effective_diffusivity.py::test_normalised_diffusivity_is_right_on_every"
    "_arrangement[3-square-1.8",
    "tests/chemistry/test_running_out.py::test_nothing_is_left_of_what_ran_out[4.0-0.0-0.3-None",
    "tests/chemistry/test_running_out.py::test_nothing_is_left_of_what_ran_out[5.0-0.0-0.3-1e-06",
    "tests/compute/test_cuda_list.py::test_lists_of_a_gpu[decisions",
    *(
        f"tests/compute/test_cuda_simulator.py::test_cuda_gives_what_the_cpu_gives[{system}]"
        for system in (
            "noisy",
            "hot_walls",
            "hot_walls_in_space",
            "trapezoidal",
            "species",
            "plates",
            "mirror",
        )
    ),
    "tests/laws/test_images.py::test_a_mirror[1]",
    "tests/laws/test_images.py::test_a_mirror[3]",
    "tests/laws/test_sweeps.py::test_divergence_of_a_linear_field[1]",
    "tests/laws/test_sweeps.py::test_momentum_of_two_materials_of_two_resolutions[3]",
    "tests/physics/test_hydrostatic_rest.py::test_a_restart_under_gravity_gives_the_same_bits[SDPD",
    "tests/schemes/test_step_limits.py::test_a_law_of_the_user_s_limits_the_step[quintic spline",
    "tests/schemes/test_step_limits.py::test_a_law_of_the_user_s_limits_the_step[trapezoidal",
    "tests/analysis/test_bounded.py::test_linear_between_plates_and_at_them[2]",
    "tests/boundaries/test_impenetrable.py::test_nothing_is_ever_inside_walls_at_rest_in_space",
    "tests/boundaries/test_impenetrable.py::test_walls_without_a_known_surface",
    "tests/boundaries/test_mirror.py::test_a_quarter_is_the_whole[TransportVelocity",
    "tests/boundaries/test_mirror.py::test_a_quarter_is_the_whole[SDPD, ",
    "tests/boundaries/test_mirror.py::test_averages_at_a_mirror",
    "tests/boundaries/test_mirror.py::test_concentrations_beside_a_mirror",
    "tests/boundaries/test_mirror.py::test_couette_flow_that_starts",
    "tests/boundaries/test_mirror.py::test_forms_and_restarts",
    "tests/boundaries/test_mirror.py::test_half_a_channel_is_the_channel[SDPD]",
    "tests/boundaries/test_mirror.py::test_in_one_and_in_three_dimensions",
    "tests/boundaries/test_mirror.py::test_plane_couette_flow_is_exact",
    "tests/boundaries/test_volume_fraction.py::test_fraction_distance_and_direction_over_a_plane[3]",
    *(
        f"tests/boundaries/test_volume_fraction.py::test_a_particle_fired_at_a_wall_comes_out[{k}-3]"
        for k in IN_SPACE
    ),
    "tests/boundaries/test_volume_fraction.py::test_bounce_back_from_a_wall_that_accelerates[1]",
    "tests/boundaries/test_wall_friction.py::test_the_automatic_step_is_stable_beside_walls_and_not"
    "_too_cautious[3D, quintic spline]",
    "tests/casefile/test_casefile_runs.py::test_the_yeast_channel_has_the_same_bits",
    "tests/cases/test_channel_flows.py::test_cubic_spline_at_three_spacings",
    "tests/cases/test_equilibrium.py::test_small_box_has_the_temperature_of_its_noise[Equilibrium3D",
    "tests/cases/test_yeast_channel.py::test_a_smaller_reynolds_number_changes_little",
    "tests/cases/test_yeast_channel.py::test_the_map_stands_beside_that_of_the_finite_elements",
    "tests/compute/test_composer.py::test_all_forms_give_the_same_to_round_off[hot walls]",
    "tests/compute/test_composer.py::test_all_forms_give_the_same_to_round_off[one dimension]",
    "tests/compute/test_composer.py::test_all_forms_give_the_same_to_round_off[transported]",
    "tests/compute/test_composer.py::test_all_forms_give_the_same_to_round_off[trapezoidal]",
    "tests/compute/test_composer.py::test_all_forms_give_the_same_to_round_off[two fluids]",
    "tests/compute/test_cuda_benchmark.py",
    "tests/compute/test_cuda_transfers.py",
    "tests/laws/test_species_flux.py::test_linear_concentration_on_a_lattice[1]",
    "tests/laws/test_species_flux.py::test_linear_concentration_on_a_lattice[3]",
    "tests/laws/test_species_flux.py::test_uniform_stays_uniform_and_amounts_are_conserved[3]",
    "tests/physics/test_density_contrast.py::test_a_heavy_fluid_above_a_light_one_falls_and_comes_to"
    "_rest[SDPD]",
    "tests/physics/test_density_contrast.py::test_the_force_of_a_uniform_pressure_does_not_know"
    "_densities[SDPD-3",
    "tests/physics/test_equilibrium_time_step.py",
    "tests/physics/test_fluids_at_rest.py::test_equipartition[8-3",
    "tests/physics/test_hydrostatic_rest.py::test_where_a_dissolved_species_is_what_weighs[SDPD]",
    "tests/physics/test_hydrostatic_rest.py::test_with_summed_density[quintic-spline]",
    "tests/physics/test_hydrostatic_rest.py::test_with_summed_density[wendland-c2]",
    "tests/schemes/test_kept_volume.py::test_in_a_closed_cavity[transport-velocity]",
    "tests/schemes/test_kept_volume.py::test_of_compressed_fluid_it_is_that_of_the_start",
    "tests/schemes/test_order_in_time.py::test_second_order[scheme1",
    "tests/schemes/test_order_in_time.py::test_second_order[scheme6",
    "tests/schemes/test_step_limits.py::test_the_automatic_step_is_stable[sound, 3D corner of",
    "tests/schemes/test_step_limits.py::test_the_automatic_step_is_stable[viscosity, 3D corner of",
    "tests/schemes/test_transport_velocity_scheme.py::test_momentum_density_and_amounts_in_a_flow[3]",
    "tests/schemes/test_transport_velocity_scheme.py::test_normalised_viscosity_is_exact_between"
    "_plates[3.0-wendland",
    "tests/test_averages.py::test_uniform_flow_to_round_off_wherever_the_particles_are",
    "tests/test_cli.py::test_bench_measures_all_that_it_names",
    "tests/test_memory_order.py::test_same_bits_for_any_order_in_memory[mirrored",
    "tests/test_notebooks.py::test_executes[case-and-results]",
    "tests/test_notebooks.py::test_executes[molecules]",
)
