"""What there is to look at: lamps, their boundaries, objects."""

import numpy as np
import pytest

from bns.models import render
from bns.worlds import registry
from bns.worlds.light import scene


@pytest.fixture(scope="module")
def spec():
    """Two lamps and a post."""
    lights = [{}, {"x": 0.7, "y": -0.4, "height": 0.1}]
    posts = [{"x": -0.5, "y": 0.3}]
    return scene.spec(registry.make("light", lights=lights, posts=posts))


def test_lamps_are_where_the_light_is(spec):
    model = spec.compile()
    assert model.site("lamp_0").pos == pytest.approx([0, 0, 0.2])
    assert model.geom("bulb_1").pos == pytest.approx([0.7, -0.4, 0.1])
    for name in ("stem_1", "foot_0", "boundary_0_0"):
        assert not model.geom(name).contype[0] and not model.geom(name).conaffinity[0]
    ring = [model.geom(f"boundary_1_{piece}").pos[:2] for piece in range(0, 48, 2)]
    far = np.hypot(*(np.array(ring) - [0.7, -0.4]).T)
    assert far == pytest.approx(0.15, abs=0.001)
    assert model.geom("object_0").size[:2] == pytest.approx([0.05, 0.15])


def test_bulbs_are_in_the_picture(spec, opengl):
    pixels = render.picture(spec, camera="overhead", size=(240, 160), shadows=False)
    yellow = (pixels[..., 0] > 200) & (pixels[..., 2] < 140)
    assert yellow.sum() >= 8
    rows, columns = np.nonzero(yellow)
    near = (np.abs(columns - 120) < 8) & (np.abs(rows - 80) < 8)
    assert near.any()  # the first lamp is in the middle


def test_no_boundary_where_nobody_watches():
    from bns.worlds.light.supervisor import Supervisor

    world = registry.make("light", supervisor=Supervisor(safety=0))
    names = [geom.name for geom in scene.spec(world).geoms]
    assert "bulb_0" in names
    assert not any(name.startswith("boundary") for name in names)
