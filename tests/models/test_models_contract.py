"""What every robot directory has to be; a new one is picked up by itself."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import OutOfBoundsError, UnknownNameError
from bns.models import numbers

FILES = ("README.md", "CHANGELOG.md", "robot.toml", "numbers.toml", "scene.xml")
KINDS = ("wheeled", "legged", "servo")

robots = pytest.mark.parametrize("name", models.names())


def smooth(model, seconds: float, seed: int) -> np.ndarray:
    """Random controls over the whole range without jumps, shape ``(S, nu)``."""
    rng = np.random.default_rng(seed)
    steps = round(seconds / model.opt.timestep)
    times = np.arange(steps) * model.opt.timestep
    rates, phases = rng.uniform(0.2, 2.0, model.nu), rng.uniform(0, 2, model.nu)
    low, high = model.actuator_ctrlrange.T
    wave = np.sin(2 * np.pi * (np.outer(times, rates) + phases))
    return (low + high) / 2 + wave * (high - low) / 2


def driven(model, controls: np.ndarray) -> tuple[np.ndarray, mujoco.MjData]:
    """Configurations after each step from home, shape ``(S, nq)``."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    seen = np.empty((len(controls), model.nq))
    for step, control in enumerate(controls):
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        seen[step] = data.qpos
    return seen, data


@pytest.fixture(scope="module")
def compiled():
    return {name: models.spec(name).compile() for name in models.names()}


@robots
def test_directory_is_complete(name):
    directory = models.path(name)
    wanted = [*FILES, f"{name}.xml", f"{name}.png"]
    assert [file for file in wanted if not (directory / file).is_file()] == []
    assert f"{name}.png" in (directory / "README.md").read_text()


@robots
def test_facts_are_complete(name):
    robot = models.robot(name)
    assert robot.kind in KINDS
    assert robot.doc and "\n" not in robot.doc
    assert robot.ctrl_per_command > 0
    for command in robot.commands:
        assert command.unit and command.low < command.high


@robots
def test_named_elements_exist(name, compiled):
    robot, model = models.robot(name), compiled[name]
    assert model.body(robot.base_body).parentid == 0
    fixed = robot.kind == "servo"  # on a stand, its base joint is the shaft
    wanted = mujoco.mjtJoint.mjJNT_HINGE if fixed else mujoco.mjtJoint.mjJNT_FREE
    assert model.joint(robot.base_joint).type == wanted
    for site in (robot.tracker_site, *robot.sensor_sites):
        model.site(site)
    for wheel in robot.wheels.values():
        model.body(wheel.body), model.joint(wheel.joint), model.actuator(wheel.actuator)
        assert model.geom(wheel.geom).conaffinity or model.geom(wheel.geom).contype
    if robot.caster_geom:
        model.geom(robot.caster_geom)
    model.geom("floor"), model.camera(robot.picture)


@robots
def test_controls_are_the_commands_in_order(name, compiled):
    robot, model = models.robot(name), compiled[name]
    order = [model.actuator(index).name for index in range(model.nu)]
    assert [command.actuator for command in robot.commands] == order
    reach = model.actuator_ctrlrange / robot.ctrl_per_command
    np.testing.assert_allclose(reach, robot.ranges, rtol=1e-3)


@robots
def test_numbers_match_the_model(name, compiled):
    table = numbers.read(models.path(name))
    found = [
        text for item in table.values() for text in item.disagreements(compiled[name])
    ]
    assert found == []
    assert all(item.source and item.unit and item.at for item in table.values())


@robots
def test_a_wrong_number_is_noticed(name, compiled):
    item = next(iter(numbers.read(models.path(name)).values()))
    wrong = numbers.Number(**{**vars(item), "value": item.value * 1.001})
    assert wrong.disagreements(compiled[name])


@robots
def test_readme_names_what_is_not_published(name):
    readme = (models.path(name) / "README.md").read_text()
    table = numbers.read(models.path(name))
    own = [item.name for item in table.values() if item.basis != "published"]
    assert [item for item in own if f"`{item}`" not in readme] == []


@robots
def test_drives_without_warnings(name, compiled):
    model = compiled[name]
    seen, data = driven(model, smooth(model, 2.0, seed=1))
    assert np.isfinite(seen).all()
    assert [int(warning.number) for warning in data.warning] == [0] * len(data.warning)
    assert np.abs(np.diff(seen, axis=0)).max() < 0.5


@robots
def test_same_controls_give_the_same_bytes(name, compiled):
    controls = smooth(compiled[name], 0.5, seed=2)
    first, _ = driven(compiled[name], controls)
    again, _ = driven(models.spec(name).compile(), controls)
    assert first.tobytes() == again.tobytes()


@robots
def test_what_only_shows_moves_nothing(name, compiled):
    controls = smooth(compiled[name], 0.5, seed=3)
    shown, _ = driven(compiled[name], controls)
    bare = models.spec(name, visuals=False).compile()
    hidden, _ = driven(bare, controls)
    assert bare.ngeom < compiled[name].ngeom
    assert shown.tobytes() == hidden.tobytes()


@robots
def test_home_rests(name, compiled):
    model = compiled[name]
    home = model.key("home")
    still = np.tile(home.ctrl, (round(1.0 / model.opt.timestep), 1))
    seen, _ = driven(model, still)
    assert np.abs(seen[-1, :3] - home.qpos[:3]).max() < 1e-4  # m
    assert np.abs(seen[-1, 3:] - home.qpos[3:]).max(initial=0) < 1e-3


@robots
def test_only_the_floor_and_what_is_paired_touch(name, compiled):
    model = compiled[name]
    floor = model.geom("floor").id
    if models.robot(name).kind == "servo":
        assert not (model.geom_contype & model.geom_conaffinity[floor]).any()
        return
    own = {
        frozenset(pair) for pair in zip(model.pair_geom1, model.pair_geom2, strict=True)
    }
    _, data = driven(model, smooth(model, 0.5, seed=4))
    assert data.ncon
    for contact in data.contact:
        assert floor in contact.geom or frozenset(contact.geom) in own


def test_robots_without_a_floor_have_none():
    spec = models.spec("khepera3", scene=False)
    assert "floor" not in [geom.name for geom in spec.geoms]
    spec.compile()


def test_unknown_names_are_refused_with_what_exists():
    for call in (models.robot, models.path, models.spec, models.scene_spec):
        with pytest.raises(UnknownNameError, match="Did you mean 'khepera3'"):
            call("khepera")
    with pytest.raises(UnknownNameError, match="option of khepera3"):
        models.spec("khepera3", ir_tabel="thesis")
    with pytest.raises(UnknownNameError, match="public, thesis"):
        models.spec("khepera3", ir_table="webots")
    assert not issubclass(UnknownNameError, OutOfBoundsError)


def test_a_directory_is_a_robot(tmp_path):
    from bns.errors import FormatError
    from bns.models import robot_model

    made = tmp_path / "beetle"
    made.mkdir()
    (made / "robot.toml").write_text('kind = "wheeled"\n')
    with pytest.raises(FormatError, match="commands"):
        robot_model.read(made)
