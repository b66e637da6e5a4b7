"""The TOML text of a description, from what was found out."""

import json
import os
from pathlib import Path

import numpy as np

from bns.gap.candidates import mjcf
from bns.gap.models.mjcf import guesses
from bns.gap.models.mjcf.channels import Work, factor, joint_of, joints, si_unit, tolds
from bns.gap.models.mjcf.config import WINDOW
from bns.gap.models.mjcf.effects import OWNERS


def toml(work: Work, out: Path) -> str:
    """The description of a robot as the text of a TOML file.

    Args:
        work: what was found in the model and the log.
        out: where the file will be; the model's path is relative to it.
    """
    model = os.path.relpath(work.path.resolve(), out.resolve().parent)
    lines = [
        f"# By `bns gap describe {work.path.name} {Path(work.log).name}`; see "
        "docs/gap_your_robot.md.",
        *(f"# Unsure: {line}" for line in work.unsure),
        f"name = {_text(work.path.stem)}",
        f"model = {_text(Path(model).as_posix())}",
    ]
    steps = np.diff(work.times[max(work.rows, key=len)])
    step = float(np.median(steps[steps > 0]))
    if 2 * step > WINDOW:
        lines.append(f"window = {2 * step:.4g}")
    for item in tolds(work):
        lines += _table(
            f"commands.{_text(item.channel.name)}",
            {
                "actuator": item.actuator,
                "unit": item.channel.unit,
                "low": item.low,
                "high": item.high,
                **{k: v for k, v in work.loop.items() if np.isfinite(v)},
            },
        )
    for column, part, unit in work.seen:
        pieces = [column.values[rows] * factor(unit) for rows in work.rows]
        axis = {"axis": part.axis} if part.axis else {}
        noise = float(f"{guesses.noise(pieces):.3g}")
        given = {
            part.quantity: part.name,
            **axis,
            "unit": si_unit(unit),
            "noise": noise,
        }
        lines += _table(f"observed.{_text(column.name)}", given)
    if work.start:
        lines += _table("start", work.start)
    return "\n".join([*lines, *_effects(work), *_log(work)]) + "\n"


def _effects(work: Work) -> list[str]:
    """[effects] where the model has bodies that no actuator can move."""
    model = work.model
    root = {}
    for joint in joints(model):
        body = int(model.joint(joint).bodyid[0])
        root[joint] = int(model.body_rootid[body])
    drives = {joint_of(model, model.actuator(a).id) for _, a, _ in work.told}
    moved = {root[joint] for joint in drives if joint in root}
    if not moved or set(root.values()) <= moved:
        return []
    bodies = {int(model.joint(j).bodyid[0]) for j in root if root[j] in moved}
    parts = {
        "joint": [j for j in root if root[j] in moved],
        "body": [model.body(b).name for b in sorted(bodies) if model.body(b).name],
        "actuator": [actuator for _, actuator, _ in work.told],
    }
    seen = [column.name for column, _, _ in work.seen]
    given = {
        name: parts.get(
            OWNERS.get(name, ""), seen if name == "sensor_gain" else ["all"]
        )
        for name in mjcf.USUAL
    }
    work.guessed.append("effects: the usual ones, on parts that the commands can move")
    return _table("effects", given)


def _log(work: Work) -> list[str]:
    """[log]: columns that are called otherwise, or are not in SI units."""
    lines = {}
    units = {c.name: unit for c, _, unit in (*work.told, *work.seen)}
    for name, (column, unit) in work.sources.items():
        if column != name or unit not in ("", "s"):
            lines[name] = (column, unit)
    for name, unit in units.items():
        if factor(unit) != 1.0:
            lines[name] = (name, unit)
    made = ["", "[log]"] if lines else []
    for name, (column, unit) in lines.items():
        more = f", unit = {_text(unit)}" if unit else ""
        made.append(f"{_text(name)} = {{ column = {_text(column)}{more} }}")
    return made


def _table(head: str, values: dict) -> list[str]:
    lines = ["", f"[{head}]"]
    for key, value in values.items():
        if isinstance(value, float):
            lines.append(f"{key} = {float(f'{value:.6g}')!r}")
        else:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    return lines


def _text(value: str) -> str:
    """A TOML string, or a bare key's text in quotes."""
    return json.dumps(value, ensure_ascii=False)
