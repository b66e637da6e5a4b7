"""MuJoCo geometry as Rerun shapes."""

import numpy as np
import pytest

from bns.viz import geometry

mujoco = pytest.importorskip("mujoco")
rr = pytest.importorskip("rerun")

XML = """
<mujoco>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="8" height="8"/>
    <material name="tiles" texture="t"/>
    <mesh name="tetra" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 .1" material="tiles"/>
    <body name="robot" pos="0 0 .1">
      <freejoint/>
      <geom type="box" size=".1 .2 .3" rgba="1 0 0 1"/>
      <geom type="capsule" size=".05 .2" pos="0 0 1" euler="0 90 0"/>
      <geom type="sphere" size=".07"/>
      <geom type="ellipsoid" size=".01 .02 .03"/>
      <geom type="cylinder" size=".04 .06"/>
      <geom type="mesh" mesh="tetra"/>
      <geom type="box" size="1 1 1" group="3"/>
      <body name="arm" pos="1 0 0">
        <joint type="hinge" axis="0 0 1"/>
        <geom type="sphere" size=".01"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


class Recorder:
    """Keeps what is logged."""

    def __init__(self):
        self.logged, self.sent = {}, {}

    def log(self, path, *parts, static):
        self.logged[path] = {type(part).__name__: part for part in parts}

    def send_columns(self, path, index, columns):
        self.sent[path] = columns


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(XML)


@pytest.fixture(scope="module")
def logged(model):
    stream = Recorder()
    geometry.log_static(stream, model)
    return stream.logged


def values(part, name):
    return np.asarray(getattr(part, name).as_arrow_array().to_pylist(), dtype=float)


def test_one_entity_a_body(logged):
    assert set(logged) == {"world/world", "world/robot", "world/arm"}
    shapes = "Boxes3D Capsules3D Ellipsoids3D Cylinders3D Mesh3D"
    assert set(logged["world/robot"]) == set(shapes.split())


def test_collision_geoms_are_left_out(logged):
    assert values(logged["world/robot"]["Boxes3D"], "half_sizes").max() < 0.5


def test_a_capsule_starts_at_its_end(logged):
    capsule = logged["world/robot"]["Capsules3D"]
    assert np.allclose(values(capsule, "translations"), [[-0.2, 0, 1]])
    assert np.allclose(values(capsule, "lengths"), [0.4])


def test_sphere_and_ellipsoid(logged):
    sizes = values(logged["world/robot"]["Ellipsoids3D"], "half_sizes")
    assert np.allclose(sizes, [[0.07] * 3, [0.01, 0.02, 0.03]])


def test_an_endless_textured_floor_has_edges_and_a_colour(logged):
    floor = logged["world/world"]["Boxes3D"]
    size, centre = values(floor, "half_sizes")[0], values(floor, "centers")[0]
    assert np.allclose(size[:2], geometry.ENDLESS)
    assert np.isclose(centre[2] + size[2], 0)  # its surface is the plane
    colour = floor.colors.as_arrow_array().to_pylist()[0]
    assert colour.to_bytes(4, "big") == bytes(geometry.FLOOR)


def test_poses_follow_the_joints(model):
    qpos = np.tile(model.qpos0, (2, 1))
    qpos[1, :3] = 1, 2, 3
    qpos[1, 3:7] = np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)  # 90 deg about z
    positions, quaternions = geometry.body_poses(model, qpos)
    arm = model.body("arm").id
    assert np.allclose(positions[:, arm], [[1, 0, 0.1], [1, 3, 3]])
    assert np.allclose(quaternions[0, arm], [0, 0, 0, 1])  # xyzw
    assert np.allclose(quaternions[1, arm, 2:], np.sqrt(0.5))


def test_planar_poses_keep_the_height(model):
    qpos = geometry.planar_qpos(model, np.array([[1.0, 2.0, np.pi]]))
    assert np.allclose(qpos[0, :7], [1, 2, 0.1, 0, 0, 0, 1])


def test_only_moving_bodies_get_poses(model):
    stream = Recorder()
    times = [rr.TimeColumn("sim_time", duration=[0.0])]
    geometry.send_poses(stream, model, times, model.qpos0[None])
    assert set(stream.sent) == {"world/robot", "world/arm"}
