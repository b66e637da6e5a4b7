"""Cases on disk: written, run without their answers, scored with them.

A casebook is a directory with one dataset per case (`worlds/data/dataset.py`), named
after the case. Its answers lie elsewhere, in one JSON file: per case the attributes of
`cases.Answer`. Others can write cases by hand: a dataset each, and an answer with at
least `kind`, `names` (of candidates) and `aliases` (per name, the candidates that are
accepted in its place, itself included). Said is one JSON line per case: `name` and the
diagnosis.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bns.errors import BnsError, FormatError
from bns.gap.bench import scoring
from bns.gap.bench.cases import Answer, Case
from bns.gap.diagnose import diagnose
from bns.gap.models.base import GapModel
from bns.gap.records import plain
from bns.progress import Each, uncounted
from bns.storage import files, reading, seal
from bns.storage.lock import Lock
from bns.worlds.data import dataset

SCHEMA, VERSION = "bns-gap-answers", 1


def make(directory: Path, answers: Path, cases: Iterable[tuple[str, Case]]) -> int:
    """Write cases and, in another place, their answers.

    Args:
        directory: of the casebook, created.
        answers: file of the answers; may not lie in the casebook.
        cases: names and cases.

    Returns:
        How many were written.

    Raises:
        BnsError: the answers would lie beside the cases or cannot be written, a case
            exists, or another process is writing there.
    """
    directory, answers = Path(directory), Path(answers)
    if directory.resolve() in answers.resolve().parents:
        raise BnsError(
            f"{answers} lies in {directory}, beside the cases: who runs them would see "
            "the answers; put it elsewhere."
        )
    if directory.is_file():
        raise BnsError(f"{directory} is a file: give a directory for the cases.")
    files.make_directory(answers.parent)
    files.check_writable(answers)
    known: dict[str, Any] = {}
    with Lock(directory):
        for name, case in cases:
            trials = [trial.replace(conditions={}, truth={}) for trial in case.trials]
            dataset.write(directory / name, trials, provenance={"case": name})
            known[name] = case.answer.as_dict()
    content = {"schema": SCHEMA, "version": VERSION, "cases": known}
    files.write_json(answers, plain(content))
    return len(known)


def run(
    directory: Path,
    model: GapModel,
    said: Path,
    *,
    seed: int = 0,
    each: Each = uncounted,
) -> int:
    """Diagnose the cases that are missing in `said`, appending as they come.

    Args:
        directory: of the cases, one dataset in each sub-directory.
        model: nominal model.
        said: JSON Lines file of diagnoses; cases named in it are skipped.
        seed: of what each diagnosis draws.
        each: goes through the cases, and may count them.

    Returns:
        How many were run.

    Raises:
        BnsError: there is no case, or another process is writing in the directory of
            `said`.
    """
    said = Path(said)
    with Lock(said.parent):
        done = {row["name"] for row in _lines(said)}
        places = sorted(p for p in Path(directory).iterdir() if p.is_dir())
        if not places:
            raise BnsError(
                f"{directory} holds no cases: make some with `bns gap bench make`."
            )
        left = [place for place in places if place.name not in done]
        return _run(each(left), model, said, seed)


def _run(places: Iterable[Path], model: GapModel, said: Path, seed: int) -> int:
    count = 0
    for place in places:
        trials = dataset.read(place).trials
        try:
            found = json.loads(diagnose(trials, model, seed=seed).to_json())
        except BnsError as error:
            found = {"error": str(error)}
        files.append_entry(said, name=place.name, diagnosis=found)
        count += 1
    return count


def score(said: Path, answers: Path) -> list[dict[str, Any]]:
    """Rows that `scoring` takes, from what was said and what is true.

    Raises:
        FormatError: the answers are not such a file, or lack a case.
    """
    known = read_answers(answers)
    rows = []
    for line in _lines(Path(said)):
        if line["name"] not in known:
            raise FormatError(f"{answers} has no answer for {line['name']!r}.")
        answer, found = known[line["name"]], line["diagnosis"]
        row = {"kind": answer["kind"], "seed": line["name"], "answer": answer}
        row["said"] = found if "error" in found else scoring.said_of(found)
        row["seconds"] = sum(found.get("seconds", {}).values())
        rows.append(row)
    return rows


def read_answers(answers: Path) -> dict[str, Any]:
    """Answers by name of the case; what is left out is as in `Answer`.

    Raises:
        FormatError: it is no such file.
    """
    content = seal.opened(reading.read_json(answers, most=reading.DATA), answers)
    try:
        if (content["schema"], content["version"]) != (SCHEMA, VERSION):
            raise FormatError(f"{answers} is not {SCHEMA} version {VERSION}.")
        return {
            name: plain({**Answer(kind=item["kind"]).as_dict(), **item})
            for name, item in content["cases"].items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{answers} holds no answers ({error}).") from error


def _lines(file: Path) -> list[dict[str, Any]]:
    lines = files.read_entries(file)
    for line in lines:
        if not (isinstance(line.get("name"), str) and "diagnosis" in line):
            raise FormatError(f"{file} holds a line without name or diagnosis.")
    return lines
