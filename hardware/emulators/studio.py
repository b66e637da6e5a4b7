"""Pictures of an emulated robot rendered by MuJoCo's own overhead camera."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bns.hardware.emulators.frames import PLATE
from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.marker import CELLS, Floor, Marker
from bns.hardware.tracking.opencv import cv2
from bns.models.render import photograph

LIFT = 0.0001  # m; a floor tag above the board, so that it shows


class Studio:
    """The arena with a Khepera III that carries a printed tag, and floor tags.

    Args:
        size: of the pictures [px].
        marker: on the robot.
        floor: tags on the board.
        noise: standard deviation of grey values.
        blur: of the lens, standard deviation [px]; without any, edges fall on whole
            pixels and no corner can be found between them.
        samples: of each pixel (multisampling).
        rng: for the noise.

    `paint` raises `MissingDependencyError` where the machine can not render.
    """

    def __init__(
        self,
        size: tuple[int, int],
        *,
        marker: Marker | None = None,
        floor: Floor | None = None,
        noise: float = 2.0,
        blur: float = 0.7,
        samples: int = 8,
        rng: np.random.Generator | None = None,
    ):
        import mujoco

        from bns import models

        self.camera, self.noise, self.blur = Camera.overhead(size), noise, blur
        self.marker = marker or Marker()
        self.rng = rng or np.random.default_rng(0)
        spec = models.scene_spec("khepera3")
        spec.visual.quality.offsamples = samples
        spec.visual.global_.offwidth, spec.visual.global_.offheight = size
        self._carry(spec)
        floor = floor or Floor()
        half = floor.side / 2 * (CELLS + 2) / CELLS
        for number, (x, y, yaw) in floor.places.items():
            plate = self._plate(spec, spec.worldbody, number, half, 1.0)
            plate.pos = [x, y, LIFT]
            plate.quat = [np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("home").id)
        self._home = self.data.qpos.copy()

    def _carry(self, spec: Any) -> None:
        """Put the tag on the robot, where its marker plate is."""
        body = spec.body("khepera3")
        border = (PLATE - 1) / 2 * CELLS
        half = self.marker.side / 2 * PLATE
        plate = self._plate(spec, body, self.marker.number, half, border)
        plate.pos = [self.marker.x, self.marker.y, self.marker.height]
        turn = self.marker.yaw / 2
        plate.quat = [np.cos(turn), 0, 0, np.sin(turn)]
        for name in ("marker_front", "marker_back"):
            spec.delete(spec.geom(name))

    def _plate(
        self, spec: Any, body: Any, number: int, half: float, border: float
    ) -> Any:
        """A flat textured square that touches nothing."""
        import mujoco

        name = f"tag_{number}"
        pixels = tags.picture(number, cell=32, border=border)  # 256: a power of 2
        texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D)
        texture.width = texture.height = len(pixels)
        texture.nchannel = 3
        # texture rows count from below, as OpenGL does
        texture.data = np.repeat(pixels[::-1, :, None], 3, axis=2).tobytes()
        material = spec.add_material(name=name, specular=0, shininess=0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        corners = np.array([[half, half], [half, -half], [-half, -half], [-half, half]])
        low = -0.0005
        points = np.vstack(
            [np.c_[corners, np.zeros(4)], np.c_[corners, np.full(4, low)]]
        )
        mesh = spec.add_mesh(name=name)
        mesh.uservert = points.ravel().tolist()
        mesh.userface = [0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4]
        across = [0.0, 1, 1, 1, 1, 0, 0, 0]
        mesh.usertexcoord = [*across, *across]
        return body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=name,
            contype=0, conaffinity=0, group=2, mass=0,
        )  # fmt: skip

    def paint(self, pose: Sequence[float]) -> np.ndarray:
        """The picture of the robot at rest at a pose, ``(H, W)`` uint8."""
        import mujoco

        x, y, yaw = pose
        self.data.qpos[:] = self._home
        self.data.qpos[:2] = x, y
        self.data.qpos[3:7] = np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
        mujoco.mj_forward(self.model, self.data)
        pixels = photograph(
            self.model, self.data, camera="overhead", size=self.camera.size
        )
        colours = pixels.astype(np.float32)
        grey = colours @ np.array([0.299, 0.587, 0.114], np.float32)
        grey = cv2().GaussianBlur(grey, (0, 0), self.blur)
        grey += self.rng.normal(0, self.noise, grey.shape)
        return np.rint(grey.clip(0, 255)).astype(np.uint8)
