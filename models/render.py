"""Pictures of models, without a display.

`mujoco.Renderer` renders through what the variable MUJOCO_GL said when MuJoCo was first
imported, and with `MUJOCO_GL=egl` MuJoCo cannot even be imported where EGL is missing.
Here the OpenGL context is made when a picture is asked for, so nothing has to be set
and physics needs no OpenGL; a MUJOCO_GL that is set is honoured.
"""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import MissingDependencyError, UnknownNameError
from bns.storage import files

PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"
"""Debian packages that rendering without a display needs"""


def picture(
    spec: Any,
    path: str | Path | None = None,
    *,
    camera: str,
    size: tuple[int, int] = (960, 640),
    shadows: bool = True,
    keyframe: str = "home",
) -> np.ndarray:
    """Render a model at rest.

    Args:
        spec: a `mujoco.MjSpec`; stays as it is.
        path: PNG to write; None writes none.
        camera: name of a camera of the model.
        size: width and height [px].
        shadows: with shadows; without a GPU they cost five times the rest.
        keyframe: the pose shown, if the model has it.

    Returns:
        The picture, shape ``(height, width, 3)``, uint8.

    Raises:
        UnknownNameError: the model has no such camera.
        MissingDependencyError: this machine can not render.
    """
    import mujoco

    known = [item.name for item in spec.cameras]
    if camera not in known:
        raise UnknownNameError("camera", camera, known)
    made = spec.copy()
    buffer = made.visual.global_
    buffer.offwidth = max(buffer.offwidth, size[0])
    buffer.offheight = max(buffer.offheight, size[1])
    model = made.compile()
    data = mujoco.MjData(model)
    if keyframe in [key.name for key in made.keys]:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    mujoco.mj_forward(model, data)
    pixels = photograph(model, data, camera=camera, size=size, shadows=shadows)
    if path is not None:
        from matplotlib.image import imsave

        files.replace(path, lambda beside: imsave(beside, pixels))
    return pixels


def photograph(
    model: Any, data: Any, *, camera: str, size: tuple[int, int], shadows: bool = True
) -> np.ndarray:
    """Render a state.

    Args:
        model: a compiled `mujoco.MjModel` whose offscreen buffer is large enough.
        data: its `mujoco.MjData`, kinematics up to date.
        camera: name of a camera of the model.
        size: width and height [px].
        shadows: see `picture`.

    Returns:
        The picture, shape ``(height, width, 3)``, uint8.

    Raises:
        MissingDependencyError: this machine can not render.
    """
    import mujoco

    view = mujoco.MjvCamera()
    view.type = mujoco.mjtCamera.mjCAMERA_FIXED
    view.fixedcamid = model.camera(camera).id
    scene = mujoco.MjvScene(model, maxgeom=5000)
    mujoco.mjv_updateScene(
        model, data, mujoco.MjvOption(), None, view, mujoco.mjtCatBit.mjCAT_ALL, scene
    )
    scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
    frame = mujoco.MjrRect(0, 0, *size)
    pixels = np.empty((size[1], size[0], 3), np.uint8)
    with _opengl(model, size) as opengl:
        mujoco.mjr_render(frame, scene, opengl)
        mujoco.mjr_readPixels(pixels, None, frame, opengl)
    return np.ascontiguousarray(pixels[::-1])  # OpenGL counts rows from below


@contextmanager
def film(
    model: Any, *, camera: str, size: tuple[int, int]
) -> Iterator[Callable[..., np.ndarray]]:
    """Draw many states of a model; gives the function that draws one.

    That takes `qpos`, shape ``(nq,)``; `discs` on the floor, as x, y, radius and half
    height [m]; and a `trail`, as points ``(S, 2)`` [m], a colour (RGBA, 0 to 1) and
    half its width [m]. It gives the picture, shape ``(height, width, 3)``, uint8.

    Args:
        model: a compiled `mujoco.MjModel` whose offscreen buffer is large enough; its
            smoothing of edges is turned off.
        camera: name of a camera of the model.
        size: width and height [px].

    Raises:
        MissingDependencyError: this machine can not render.
    """
    import mujoco

    model.vis.quality.offsamples = 0  # four times as fast where there is no GPU
    data, view = mujoco.MjData(model), mujoco.MjvCamera()
    view.type = mujoco.mjtCamera.mjCAMERA_FIXED
    view.fixedcamid = model.camera(camera).id
    scene = mujoco.MjvScene(model, maxgeom=5000)
    frame = mujoco.MjrRect(0, 0, *size)
    with _opengl(model, size) as opengl:

        def draw(qpos: np.ndarray, *, discs: Any = (), trail: Any = None) -> np.ndarray:
            """The picture of a configuration, ``(H, W, 3)`` uint8."""
            data.qpos[:] = qpos
            mujoco.mj_forward(model, data)
            every = mujoco.mjtCatBit.mjCAT_ALL
            mujoco.mjv_updateScene(
                model, data, mujoco.MjvOption(), None, view, every, scene
            )
            scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
            for x, y, radius, height in discs:
                _disc(scene, (x, y, height), radius)
            if trail is not None:
                _trail(scene, *trail)
            pixels = np.empty((size[1], size[0], 3), np.uint8)
            mujoco.mjr_render(frame, scene, opengl)
            mujoco.mjr_readPixels(pixels, None, frame, opengl)
            return np.ascontiguousarray(pixels[::-1])

        yield draw


def _disc(scene: Any, at: tuple[float, float, float], radius: float) -> None:
    import mujoco

    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        np.array([radius, at[2], 0.0]),
        np.array(at),
        np.eye(3).ravel(),
        np.array([0.94, 0.89, 0.26, 0.6], np.float32),
    )
    scene.ngeom += 1


def _trail(scene: Any, points: np.ndarray, colour: np.ndarray, width: float) -> None:
    import mujoco

    room = scene.maxgeom - scene.ngeom - 1
    step = max(1, -(-len(points) // room))
    points = np.column_stack([points[::step], np.full(len(points[::step]), width)])
    for begin, end in pairwise(points):
        geom = scene.geoms[scene.ngeom]
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE
        mujoco.mjv_initGeom(
            geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), colour.astype(np.float32)
        )
        mujoco.mjv_connector(geom, kind, width, begin, end)
        scene.ngeom += 1


@contextmanager
def _opengl(model: Any, size: tuple[int, int]) -> Iterator[Any]:
    """MuJoCo's rendering context, to draw off screen.

    Raises:
        MissingDependencyError: there is no OpenGL.
    """
    import mujoco

    try:
        window = _window(size)
        window.make_current()
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    except (
        ImportError,
        AttributeError,
        OSError,
        RuntimeError,
        mujoco.FatalError,
    ) as error:
        raise MissingDependencyError(
            "a picture", f"OpenGL ({error})", f"apt-get install {PACKAGES}"
        ) from error
    try:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        yield context
    finally:
        context.free()
        window.free()


def _window(size: tuple[int, int]) -> Any:
    """An OpenGL context of the platform: EGL on Linux, unless MUJOCO_GL says else."""
    chosen = os.environ.get("MUJOCO_GL") or "egl"
    if sys.platform == "linux" and chosen == "egl":
        from mujoco.egl import GLContext
    else:
        from mujoco import GLContext
    return GLContext(*size)
