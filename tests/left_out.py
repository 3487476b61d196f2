"""What `make test` leaves to `make test-all`, by the beginnings of test ids.

They are marked `slow` in conftest.py. Each compiled version of the solver costs everybody some 15
seconds of processor time with a cold cache: RARE are tests that need one which hardly any other
test shares. LONG are those that take longest by themselves.
"""

# Scenes of which no family of environments and no larger group of tests is made.
LONELY_SCENES = (
    "colliding_patches",
    "couette",
    "droplet",
    "lid_driven_cavity",
    "oscillating_drop",
    "perturbed_lattice",
    "poiseuille",
    "rotating_square",
    "sloshing",
    "standing_wave",
    "taylor_green",
    "water_jet",
)
RARE = (
    *(f"tests/scenes/test_scenes.py::test_every_scene_starts_at_rest_density[{name}]"
      for name in LONELY_SCENES),
    *(f"tests/solver/test_diagnostics.py::test_scenes_start_well[{name}]"
      for name in LONELY_SCENES),
    "tests/scenes/test_channel_flows.py::test_a_coarse_run_follows_the_series",
    "tests/scenes/test_channel_flows.py::test_poiseuille_flow_is_as_viscous_as_it_should_be",
    "tests/scenes/test_dam_break.py::test_a_column_as_high_as_wide_and_an_obstacle_run",
    "tests/scenes/test_dam_break.py::test_bed_and_obstacle_are_in_step_with_the_lattice",
    "tests/scenes/test_drops.py::test_a_coarse_drop_oscillates_as_it_should",
    "tests/scenes/test_drops.py::test_a_drop_of_water_rings_and_does_not_boil",
    "tests/scenes/test_free_bodies.py::test_a_coarse_square_keeps_turning",
    "tests/scenes/test_free_bodies.py::test_a_small_lattice_keeps_its_energy",
    "tests/scenes/test_free_bodies.py::test_coarse_patches_lose_what_the_impact_costs",
    "tests/scenes/test_free_bodies.py::test_energy_from_nowhere_is_the_error_of_the_lattice",
    "tests/scenes/test_lid_driven_cavity.py::test_a_coarse_run_finds_the_vortex",
    "tests/scenes/test_taylor_green.py::test_a_coarse_run_decays_as_it_should",
    "tests/scenes/test_water_jet.py::test_a_coarse_run_pushes_as_hard_as_it_should",
    "tests/scenes/test_waves.py::",
    "tests/agents/test_training.py::test_train_export_resume[dqn]",
    "tests/agents/test_training.py::test_train_export_resume[ppo_lagrangian]",
    "tests/agents/test_training.py::test_train_export_resume[sac]",
    "tests/controllers/test_rules.py::test_the_tuned_rule_is_stable[hydrostatic_tank",
    "tests/docs/test_examples.py::test_every_example_runs_and_draws[recommendation.py]",
    "tests/doctor/test_here.py::test_it_keeps_the_protocol",
    "tests/env/test_manifest.py::test_shipped_references_are_what_their_flows_do[patch_impact-v",
    "tests/env/test_reference.py::test_viscous_scenes_can_be_tuned[lid_driven_cavity]",
    "tests/env/test_tuning.py::test_observations_stay_in_their_space_whatever_is_done"
    "[sph_gym/HydrostaticTank-v1]",
    "tests/recommend/test_advice.py::test_what_is_shipped_gives_advice[couette]",
    "tests/recommend/test_advice.py::test_what_is_shipped_gives_advice[taylor_green]",
    "tests/recommend/test_tables.py::test_what_is_shipped_is_what_the_solver_gives[couette",
    "tests/solver/test_effects.py::test_a_drop_that_is_shifted_stays_a_drop",
    "tests/solver/test_origin.py::test_a_fluid_10_km_away_moves_as_one_at_home",
    "tests/solver/test_origin.py::test_a_snapshot_goes_on_to_the_last_bit",
    "tests/solver/test_origin.py::test_angular_momentum_and_potential_energy_are_those_of_the_us",
    "tests/solver/test_origin.py::test_nothing_is_displaced_where_the_precision_suffices",
    "tests/solver/test_plates.py::test_nobody_leaves_",
    "tests/solver/test_walls.py::test_a_short_dam_break_does_not_leak",
    "tests/studies/test_honesty.py::test_the_reference_itself_keeps_within_tolerance",
    "tests/studies/test_stability.py::test_a_damaged_run_is_never_perfect",
    "tests/studies/test_stability.py::test_a_solver_that_stands_still_fails_every_case"
    "[corner jet, boundary particles]",
    "tests/studies/test_stability.py::test_a_solver_that_stands_still_fails_every_case[h/dx",
    "tests/studies/test_stability.py::test_a_solver_that_stands_still_fails_every_case[pairing, c",
    "tests/studies/test_stability.py::test_a_solver_that_stands_still_fails_every_case[rotating",
    "tests/studies/test_stability.py::test_boundary_particles_hold_what_they_are_meant_for",
    "tests/studies/test_stability.py::test_finished_runs_are_kept",
    "tests/studies/test_stability.py::test_single_precision_that_counts_from_afar_is_seen",
    "tests/studies/test_stability_checks.py::test_a_particle_behind_a_wall_is_seen[corner jet, b",
    "tests/studies/test_stability_checks.py::test_a_sample_is_compared_in_single_precision_too",
    "tests/test_command_line.py::test_every_assignment_counts_and_words_are_values",
    "tests/test_docs.py::test_every_program_runs[docs/solver.md-9]",
    "tests/test_fuzz.py::test_any_scene_and_controls_run_or_are_reported",
    "tests/test_trajectory.py::test_the_command_line_saves_the_start_and_every_frame",
)  # fmt: skip
LONG = (
    "tests/agents/test_ppo_lagrangian.py::test_it_learns_to_keep_the_limit_and_a_checkpoint",
    "tests/docs/test_site_pages.py::test_every_id_has_the_page_that_the_command_prints",
    "tests/doctor/test_checkup.py::test_one_seed_one_diagnosis",
    "tests/doctor/test_healthy.py::test_nothing_is_wrong_with_it[Layers]",
    "tests/doctor/test_healthy.py::test_nothing_is_wrong_with_it[Wendland_x_v]",
    "tests/env/test_conformance.py::test_processes_of_their_own_change_nothing",
    "tests/env/test_exploits.py::test_disguises_gain_nothing_in_the_mean",
    "tests/recommend/test_text.py::test_recommendations_need_no_extra",
    "tests/solver/test_batch.py::test_simulations_of_all_kinds",
    "tests/solver/test_images.py::test_a_dam_that_stands_free_keeps_its_shape",
    "tests/solver/test_images.py::test_water_in_a_box_stays_at_rest_and_keeps_its_level[3.0]",
    "tests/solver/test_images.py::test_water_in_a_box_stays_at_rest_and_keeps_its_level[4.0]",
    "tests/solver/test_jit.py::test_damaged_machine_code_is_made_anew_with_a_warning",
    "tests/solver/test_pressures.py::test_far_from_the_origin_and_in_single_precision",
    "tests/test_docs.py::test_every_example_passes_its_tests[Add an effect]",
)
LEFT_OUT = RARE + LONG
