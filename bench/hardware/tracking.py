"""How exact the overhead tracking is, on pictures of MuJoCo's own camera."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.result import Result, bench
from bns.hardware.emulators.camera import PLATE
from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.camera import Camera, cv2
from bns.hardware.tracking.marker import CELLS, Floor, Marker
from bns.models.render import photograph

BARS = {720: (1.0, 1.0), 1080: (0.3, 0.3)}  # mm, deg
WRONG = 0.020  # m


@bench(
    "tracking of the robot's tag on rendered 720p and 1080p frames: position error",
    bar="median <= 1 mm, 1 deg at 720p; <= 0.3 mm, 0.3 deg at 1080p; height "
    "+20 mm found",
)
def tracking(quick: bool) -> Result:
    """Poses all over the board; the camera's place comes from the floor tags.

    The figure is the median position error at 1080p.
    """
    poses = 12 if quick else 100
    details, holds = {}, True
    for size in ((1280, 720), (1920, 1080)):
        row = _measure(size, poses)
        limits = BARS[size[1]]
        good = (
            row["position median mm"] <= limits[0]
            and row["heading median deg"] <= limits[1]
            and row["missed"] == 0
            and row["right height agrees"]
            and not row["height wrong by 20 mm agrees"]
        )
        details[f"{size[1]}p"] = row
        holds = holds and good
    figure = details["1080p"]["position median mm"]
    return Result(figure=figure, unit="mm", holds=holds, n=poses, details=details)


def _measure(size: tuple[int, int], count: int) -> dict:
    from bns.hardware.tracking import calibrate
    from bns.hardware.tracking.marker import Floor
    from bns.hardware.tracking.tracker import Frame, Tracker

    rng, floor = np.random.default_rng(7), Floor()
    studio = Studio(size, rng=rng)
    empty = studio.paint((0.0, 0.0, 0.0))
    camera = calibrate.place(empty, studio.camera, floor)
    tracker = Tracker(camera, studio.marker)
    errors, pairs = [], []
    for number in range(count):
        pose = rng.uniform([-1.15, -0.65, -3.1], [1.15, 0.65, 3.1])
        frame = Frame(float(number), studio.paint(pose), number)
        sighting = tracker.see(frame)
        if sighting is None:
            continue
        error = sighting.pose - pose
        error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
        errors.append(error)
        pairs.append((frame, sighting))
    row = _figures(np.array(errors), count)
    row |= _heights(pairs, camera, studio.marker, empty, floor)
    away = camera.position - studio.camera.position
    row["camera's place off mm"] = np.round(away * 1e3, 2).tolist()
    return row


def _figures(errors: np.ndarray, count: int) -> dict:
    apart = np.hypot(errors[:, 0], errors[:, 1]) * 1e3
    turned = np.degrees(np.abs(errors[:, 2]))
    return {
        "position median mm": round(float(np.median(apart)), 4),
        "position p95 mm": round(float(np.quantile(apart, 0.95)), 4),
        "heading median deg": round(float(np.median(turned)), 4),
        "heading p95 deg": round(float(np.quantile(turned, 0.95)), 4),
        "missed": count - len(errors),
    }


def _heights(pairs, camera, marker, image, floor) -> dict:
    """The height check with the right setting, and with one 20 mm off."""
    from dataclasses import replace

    from bns.hardware.tracking import calibrate
    from bns.hardware.tracking.tracker import Tracker

    right = calibrate.height(
        [s for _, s in pairs], camera, marker, image=image, floor=floor
    )
    lower = replace(marker, height=marker.height - WRONG)
    tracker = Tracker(camera, lower)
    seen = [tracker.see(frame) for frame, _ in pairs]
    sightings = [item for item in seen if item is not None]
    wrong = calibrate.height(sightings, camera, lower, image=image, floor=floor)
    return {
        "height found mm": round(right.height * 1e3, 2),
        "height true mm": round(marker.height * 1e3, 2),
        "right height agrees": right.agrees,
        "height wrong by 20 mm agrees": wrong.agrees,
    }


LIFT = 0.0001  # m; a floor tag above the board, so that it shows
SAMPLES = 8  # of each pixel (multisampling)
NOISE = 2.0  # standard deviation of grey values
BLUR = 0.7
"""px; standard deviation of the lens: without any, edges fall on whole pixels and no
corner can be found between them"""


class Studio:
    """The arena with a Khepera III that carries a printed tag, and floor tags.

    Args:
        size: of the pictures [px].
        rng: for the noise.

    `paint` raises `MissingDependencyError` where the machine can not render.
    """

    def __init__(
        self, size: tuple[int, int], *, rng: np.random.Generator | None = None
    ):
        import mujoco

        from bns import models

        self.camera, self.marker = Camera.overhead(size), Marker()
        self.rng = rng or np.random.default_rng(0)
        spec = models.scene_spec("khepera3")
        spec.visual.quality.offsamples = SAMPLES
        spec.visual.global_.offwidth, spec.visual.global_.offheight = size
        self._carry(spec)
        floor = Floor()
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
        grey = cv2().GaussianBlur(grey, (0, 0), BLUR)
        grey += self.rng.normal(0, NOISE, grey.shape)
        return np.rint(grey.clip(0, 255)).astype(np.uint8)
