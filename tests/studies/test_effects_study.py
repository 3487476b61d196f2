import ast
import json
import os
import py_compile
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sph_gym
from sph_gym import scenes
from sph_gym.studies import effects, variants
from sph_gym.studies.assembly import count_in
from sph_gym.studies.cutting import copy_without

# What is left of each effect's code nowhere in the files of the step.
CODE = {
    "artificial_viscosity": ("add_artificial_viscosity",),
    "laminar_viscosity": ("add_laminar_viscosity",),
    "quadratic_viscosity": ("add_quadratic_viscosity", "density_sum: Any"),
    "tensile_correction": ("add_tensile_correction", "stress_i: Any"),
    "surface_tension": ("add_surface_tension",),
    "shifting": ("def add_crowding", "def add_shift", "cx: Any"),
    "xsph": ("add_xsph", "add_smoothing", "sx: Any", "sums.sx"),
    "gravity": ("def add_gravity(effect", "add_gravity(model", "add_gravity(gravity"),
    "box": ("confine(",),
    "walls": (
        "or compute_wall_density(",
        "sort_into_cells(rank, n_threads, team, grid, source, walls",
        "add_forces(target, walls",
    ),
}
STEP = ("effects.py", "density.py", "forces.py", "integrators.py", "stepping.py")

STEPS = """
import hashlib, json, sys
from sph_gym import Simulation, scenes
from sph_gym.studies.variants import EFFECTS, left_out
import sph_gym
digests = {}
for effect in json.loads(sys.argv[1]):
    sim = Simulation(left_out(scenes.make("dam_break", dx=0.1), effect), threads=1)
    sim.advance(3 * sim.controls.dt)
    state = sim.x.tobytes() + sim.v.tobytes() + sim.p.tobytes()
    digests[effect] = hashlib.sha256(state).hexdigest()
print(json.dumps([sph_gym.__file__, digests]))
"""


def digests(package, names):
    done = subprocess.run(
        [sys.executable, "-c", STEPS, json.dumps(names)],
        cwd=package.parent,
        env=os.environ | {"PYTHONPATH": str(package.parent), "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    path, found = json.loads(done.stdout)
    assert Path(path).parent.samefile(package)
    return found


@pytest.fixture(scope="module")
def untouched():
    return digests(Path(sph_gym.__file__).parent, list(variants.EFFECTS))


@pytest.mark.parametrize("effect", variants.EFFECTS)
def test_an_effect_is_cut_out(effect, tmp_path, untouched):
    copy = copy_without(effect, tmp_path)
    text = "".join((copy / "solver" / name).read_text() for name in STEP)
    for word in CODE[effect]:
        assert word not in text
    for path in (copy / "solver").glob("*.py"):
        ast.parse(path.read_text())
        py_compile.compile(str(path), doraise=True)
    assert digests(copy, [effect]) == {effect: untouched[effect]}


def test_nothing_to_cut(tmp_path):
    with pytest.raises(ValueError, match="no code is guarded by 'sorcery'"):
        copy_without("sorcery", tmp_path)


@pytest.mark.parametrize("effect", variants.EFFECTS)
def test_variants(effect):
    scene = scenes.make("dam_break", dx=0.1)
    without = variants.left_out(scene, effect)
    assert not variants.names(without, effect)
    assert variants.left_out(without, effect) is without
    for other in variants.EFFECTS:
        if other != effect:
            assert variants.names(without, other) == variants.names(scene, other)
    if effect == "walls":
        with pytest.raises(ValueError, match="no boundary particles"):
            variants.added(without, effect)
    else:
        assert variants.names(variants.added(without, effect), effect)


@pytest.mark.parametrize("name", scenes.names())
@pytest.mark.parametrize("effect", variants.EFFECTS)
def test_any_effect_can_be_left_out_of_any_scene(name, effect):
    scene = scenes.make(name)
    without = variants.left_out(scene, effect)
    assert not variants.names(without, effect)
    ends = () if scene.walls is None else (scene.walls.period_x, scene.walls.period_y)
    if effect == "walls" or (effect == "box" and ends and None not in ends):
        with pytest.raises(ValueError, match="can be added"):
            variants.added(without, effect)
    else:
        assert variants.names(variants.added(without, effect), effect)


LISTING = """
	.type	main,@function
main:
	.cfi_startproc
	movabsq	$helper, %rax
	callq	*%rax
.LBB0_1:
	nop
.LBB0_2:
	vsqrtpd	%ymm0, %ymm1
	vdivpd	%ymm0, %ymm1, %ymm2
	jne	.LBB0_2
	jne	.LBB0_1
	retq
	.size	main, .Lfunc_end0-main
	.type	cpython.main,@function
cpython.main:
	nop
	.size	cpython.main, .Lfunc_end1-cpython.main
	.type	helper,@function
helper:
	retq
	.size	helper, .Lfunc_end2-helper
	.type	unused,@function
unused:
	nop
	.size	unused, .Lfunc_end3-unused
"""


def test_instructions_are_counted():
    assert count_in(LISTING) == (9, 3)
    with pytest.raises(ValueError, match="no functions"):
        count_in("main:\n\tnop\n")


def test_rows_of_a_comparison():
    ours = {"instructions": 100, "loop": 11, "bytes": 8}
    cut = {"instructions": 100, "loop": 10, "bytes": 8}
    rows = {r.quantity: r for r in effects.compared("xsph, a", ours, cut, [1.0, 1.01, 9.0])}
    assert [row.holds for row in rows.values()] == [True, False, True, True]
    assert rows["absent: time of a step"].value == pytest.approx(1.0)
    none = {"instructions": None, "loop": None, "bytes": 8}
    assert len(list(effects.compared("xsph, a", none, none, [1.0]))) == 2


def test_presence_is_timed(monkeypatch):
    plan = effects.Plan({"relaxation": 0.05}, 1, 1000)
    rows = list(effects.present(plan, "relaxation", "laminar_viscosity"))
    assert {row.unit for row in rows} == {"% of a step", "ns/fluid particle"}
    assert {row.case for row in rows} == {"laminar_viscosity, relaxation"}
    assert all(np.isfinite(row.value) for row in rows)
    assert list(effects.present(plan, "relaxation", "walls")) == []


def test_a_worker_that_dies_is_told_of(tmp_path):
    broken = tmp_path / "sph_gym"
    broken.mkdir()
    (broken / "__init__.py").write_text("raise SystemExit(3)")
    with (
        pytest.raises(OSError, match="ended early"),
        effects.Worker(broken, {"scene": "relaxation"}) as worker,
    ):
        worker.report()
