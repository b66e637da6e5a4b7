"""What a report says of figures is true of the runs, of any learner and task."""

import re
from dataclasses import replace

import numpy as np
import pytest

from bns.experiment.loading import with_learner
from bns.tasks import light, walk
from bns.tasks.base import Curve
from bns.viz import captions, figures, recording, report, scene
from bns.viz.page import Picture


def blind(record):
    """Runs of a learner that foresees nothing, never damaged."""
    config = with_learner(record.config, "random")
    config = config.with_({"world.damage": ()})
    kept = ("fitness", "fitness_best", "reached", "solved", "damaged", "commands")
    columns = {name: record[name] for name in kept}
    columns["best_seen"] = np.minimum.accumulate(record["fitness"], axis=1)
    return replace(
        record,
        config=config,
        columns=columns,
        predicted=np.full_like(record.predicted, np.nan),
        damage_onset=np.full(record.replicates, -1),
    )


@pytest.fixture
def written(monkeypatch, tmp_path):
    """The text of a report, without pictures."""
    nothing = Picture("data:image/svg+xml,", "data:image/svg+xml,")
    monkeypatch.setattr(report, "picture", lambda figure: nothing)
    monkeypatch.setattr(report, "portrait", lambda robot: None)

    def text(runs):
        page = report.write(runs, tmp_path / "a.html").read_text("utf-8")
        return " ".join(page.split())

    return text


SNN, DASHED = "evolved inside the SNN", "Dashed: where the simulator network (SNN)"
ONSET, TOLD = "marks the onset of damage", "Damage is never announced"


def test_of_bns_after_damage_all_is_said(written, record):
    text = written(record)
    for said in (SNN, DASHED, ONSET, TOLD, "before the damage, and then, counted"):
        assert said in text


def test_of_another_learner_without_damage_none_of_it_is(written, record):
    text = written(blind(record))
    for said in ("SNN", "euro-simulation", "Dashed", ONSET, TOLD, "before the damage"):
        assert said not in text
    assert "The learner random: Random search" in text
    assert "the band holds the middle half of them." in text


def test_of_both_each_has_its_own(written, record):
    text = written({"a": record, "b": blind(record)})
    shown = re.findall("<figcaption>(.*?)</figcaption>", text)
    assert sum("Dashed: where" in caption for caption in shown) == 1
    assert SNN in text and "The learner random" in text


def test_a_task_without_captions_is_not_read_as_navigation(monkeypatch, record):
    shown = replace(
        scene.picture(record.config),
        captions={},
        reached="At the edge",
        solved="at the edge",
        discs="The disc is the edge.",
        curve=Curve(label="distance [m]", log=False),
    )
    monkeypatch.setattr(scene, "picture", lambda config: shown)
    said = [captions.caption(n, {"": record}) for n in ("path", "fitness", "solved")]
    assert "The disc is the edge." in said[0]
    assert said[1].startswith("Distance [m] of the controller tried in each trial. The")
    assert said[2].startswith("First: at the edge. Then: share of runs whose trial sol")
    assert not any("objective" in text or "logarithmic" in text for text in said)
    assert captions.title("solved", record) == "At the edge"


def test_a_legend_has_what_is_drawn(record):
    def legend(made):
        return {text.get_text() for text in figures.path(made).legends[0].get_texts()}

    assert {"as the SNN predicted it", "as the robot went"} <= legend(record)
    assert not any("predicted" in text for text in legend(blind(record)))


def test_readings_that_nothing_foresaw_have_no_line(record):
    seen = np.zeros((*record.poses.shape[:3], 2))
    for extra, lines in (({}, 1), ({"readings_predicted": seen}, 2)):
        made = replace(record, extra={"readings": seen, **extra})
        figure = figures.readings(made)
        assert len(figure.legends[0].get_texts()) == lines
        assert len(figure.axes[0].lines) == lines


def test_a_recording_says_what_is_dashed(record):
    assert recording._dashed(record) == ", dashed trails where the SNN said it would go"
    assert recording._dashed(blind(record)) == ""


def test_captions_of_walking_and_light_are_as_conditional():
    for own in (walk.CAPTIONS, light.CAPTIONS):
        assert "{foreseen}" in own["path"] and "SNN" not in own["path"]
    assert (
        "{again}" in walk.CAPTIONS["waits"] and "{read}" in light.CAPTIONS["readings"]
    )
