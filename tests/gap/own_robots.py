"""What tests of a user's own robot share."""

from bns.gap.describe import Description, describe
from bns.gap.models.mjcf.model import OwnModel


def described(folder, mjcf, log, **loop) -> tuple[Description, OwnModel]:
    """A robot described from a log, and the model of that description.

    Args:
        folder: where its MJCF and its description are written.
        mjcf: text of the former.
        log: file.
        loop: gains of its own, as `describe` takes them.
    """
    (folder / "robot.xml").write_text(mjcf)
    own = folder / "own.toml"
    found = describe(folder / "robot.xml", log, out=own, **loop)
    found.write(own)
    return found, OwnModel.read(own, threads=1)
