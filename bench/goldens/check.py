"""Do tiny runs, diagnoses and a report still say what they said, byte for byte?

    python -m bench goldens              compare with what is kept in goldens.json
    python -m bench.goldens --record     keep what comes out now
    python -m bench.goldens --only 'light *' --keep DIR

Everything goes through the command line, so the same file runs before and after the
package's modules have moved. Hashes hold for one kind of processor and one set of
package versions; those of other environments stay in the file beside them.
"""

import fnmatch
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from bench.goldens import content
from bench.result import Result, bench
from bench.storage import sample_files
from bench.versions import ROOT

KEPT = Path(__file__).resolve().parent / "goldens.json"
PACKAGES = ("mujoco", "numpy", "scipy", "torch")
QUICK = ("* plain", "diagnosis arm", "diagnosis odometry")
LIMIT = 3600.0  # [s] for one command; machines are shared

Items = dict[str, dict[str, content.Hashes]]

COMMON = (
    "--trials 8 --replicates 2 --record-replicates 1 --seed 5 --compiled no "
    "--threads 1 --rerun off --no-report --evolution.population 12 "
    "--evolution.generations 3 --evolution.tournament 3 --snn.epochs 10 "
    "--adaptation.window 0 "
)
BASES = {
    "navigation": "khepera-simple --world.damage wheel_gain:wheel=left,factor=0.6@4",
    "static": "khepera-simple --world.name static-snn "
    "--world.damage wheel_gain:wheel=left,factor=0.6@4",
    "light": "khepera-light --light.cycles 12 --light.circle-cycles 5 "
    "--light.starts 2 --light.reset-elitists 2 "
    "--world.damage sensor_stuck_min:sensor=left,blend=1@4",
    "walk": "hexapod-walk --walk.commands 4 --snn.hidden 10 "
    "--adaptation.simulator-reset-every 0 "
    "--world.damage leg_raised:legs=1,5,blend=1@4",
}
FORGET = (
    "--watch.forget --watch.forget-factor 0.5 --watch.forget-least 2 "
    "--watch.forget-floor 0.001 --watch.forget-reach 1.0"
)
DETECT = (
    "--watch.detect --watch.threshold 0.5 --watch.warmup 2 --watch.history 3 "
    "--watch.near 2 --watch.reach 2.0 --adaptation.population-reset "
    "--adaptation.simulator-reset"
)
ADAPTATIONS = {
    "plain": "",
    "undamaged": "--world.damage",
    "window": "--adaptation.window 30",
    "population reset": "--adaptation.population-reset",
    "simulator reset": "--adaptation.simulator-reset",
    "simulator reset every": "--adaptation.simulator-reset-every 3",
    "data reset": "--adaptation.data-reset",
    "restart": "--adaptation.restart",
    "intermittent reset": "--adaptation.extra population_reset_every:trials=3",
    "mutation after": "--adaptation.mutation-rate-after 0.5 "
    "--adaptation.mutation-magnitude-after 900",
    "detect": DETECT,
    "forget": FORGET,
}
OWN = {
    "navigation": {
        "ensemble": "--snn.kind ensemble --snn.members 2 --choose disagreement",
        "infinity": "--task.name infinity --choose best-worst-random",
        "intermittent wheel": "--world.damage wheel_intermittent:every=3@4",
        "tracker": "--world.reality tracker_noise:position_sd=0.002,heading_sd=0.01",
    },
    "static": {},
    "light": {
        "reset every": "--light.reset-every 3",
        "islands": "--light.islands 3 --light.renewed 1 --light.migration-every 2",
        "migration": "--light.islands 3 --light.migration-every 2 "
        "--light.migrant tournament --light.replaced worst --light.topology random",
        "recurrent": "--light.recurrent --light.no-mirror --light.noise 0 "
        "--light.batch 0 --light.bearing angle --light.readings balanced",
        "recover": "--light.islands 4 --light.renewed 2 --light.migrants 0 "
        "--light.charge-stopped far --adaptation.window 60",
    },
    "walk": {
        "repeat": "--walk.repeat-after 0.9",
        "printed": "--walk.fitness printed --walk.batch 0 --walk.activation sigmoid",
        "static": "--world.name static-snn",
    },
}
LACKING = {("walk", "detect")}
"""adaptations that a learner refuses"""
ON_STATIC = ("plain", "window", "detect")
WALK_FORGET = (
    "--watch.forget --trials 14 --evolution.generations 1 "
    "--evolution.mutation-rate 0.02 --evolution.headless-chicken 0 "
    "--world.damage leg_raised:legs=1,2,5,6,blend=1@7"
)
HEXAPOD = ["--model", "phantomx", "--trials", "4-5"]
CAMPAIGN = """\
name = "goldens"
preset = "khepera-simple"
replicates = 2
seed = 3

[settings]
trials = 6
compiled = "no"
evolution.population = 12
evolution.generations = 3
snn.epochs = 10
world.damage = ["wheel_gain:wheel=left,factor=0.6@3"]

[grid]
adaptation.window = [0, 30]
"""


@bench(
    "tiny runs, diagnoses, a campaign and a report: items whose bytes are as before",
    bar="all",
)
def goldens(quick: bool) -> Result:
    """Compare; the figure is the number of items that are as before."""
    kept = stored(KEPT).get(key(), {}).get("items", {})
    with tempfile.TemporaryDirectory(prefix="goldens-") as place:
        found = computed(Path(place), QUICK if quick else ("*",))
    if not kept:
        note = "nothing is kept for this environment: python -m bench.goldens --record"
        return Result(
            figure=0, unit="kept", holds=None, n=len(found), details={"note": note}
        )
    differing = compared(found, kept)
    same = len(found) - len(differing)
    return Result(
        figure=same,
        unit=f"of {len(found)}",
        holds=not differing,
        n=len(found),
        details={"environment": key(), "differing": differing},
    )


def batches() -> dict[str, list[str]]:
    """Words of `bns run` by item: each learner with each adaptation."""
    found = {}
    for base, words in BASES.items():
        for name, more in (ADAPTATIONS | OWN[base]).items():
            if (base, name) in LACKING or (base == "static" and name not in ON_STATIC):
                continue
            if (base, name) == ("walk", "forget"):
                more = WALK_FORGET
            preset, *own = words.split()
            # a setting given twice is taken as given last
            found[f"{base} {name}"] = [preset, *_last(f"{COMMON} {more}", own)]
    return found


def computed(place: Path, patterns: Sequence[str] = ("*",)) -> Items:
    """Run the items whose names match, each in a directory of its own, and hash.

    An item whose command fails is empty; what was said is printed.
    """
    found: Items = {}
    for name, words, needs in commands(place):
        if not any(fnmatch.fnmatch(name, pattern) for pattern in patterns):
            continue
        out = place / name.replace(" ", "-")
        started = time.perf_counter()
        try:
            for need, other in needs.items():
                if not (place / need).exists():
                    _bns(other)
            _bns(words)
            found[name] = content.of_directory(out, place, ROOT)
        except RuntimeError as error:
            print(error, file=sys.stderr)
            found[name] = {}
        print(f"{name}: {time.perf_counter() - started:.1f} s", file=sys.stderr)
    return found


def commands(place: Path) -> Iterator[tuple[str, list[str], Mapping[str, list[str]]]]:
    """Item, words of its command, and the commands for the directories it needs."""
    runs = {}
    for name, words in batches().items():
        out = name.replace(" ", "-")
        runs[out] = ["run", *words, "--out", str(place / out)]
        yield name, runs[out], {}
    file = place / "campaign.toml"
    file.write_text(CAMPAIGN)
    engine = ["--engine", "inline", "--out", str(place / "campaign")]
    yield "campaign", ["campaign", "run", str(file), *engine], {}
    yield from _made(place)
    yield from _diagnoses(place, runs)
    yield from _reports(place, runs)


def _made(place: Path) -> Iterator[tuple[str, list[str], dict[str, list[str]]]]:
    """Datasets of cases that the package makes up itself."""
    for name, model, kinds in (
        ("wheeled", "khepera3", ["single", "none", "pair", "fault"]),
        ("arm", str(ROOT / "examples/arm/arm.toml"), ["single", "none", "off-library"]),
    ):
        out = place / f"cases-{name}"
        words = ["gap", "bench", "make", str(out / "cases"), "--model", model]
        words += ["--answers", str(out / "answers.json"), "--count", "1"]
        yield f"cases {name}", [*words, "--kinds", *kinds], {}


def _diagnoses(
    place: Path, runs: Mapping[str, list[str]]
) -> Iterator[tuple[str, list[str], dict[str, list[str]]]]:
    """One diagnosis a family of models."""
    changed, unchanged = sample_files.servo(place / "logs" / "servo")
    driven = sample_files.odometry(place / "logs" / "odometry")
    made = {name.replace(" ", "-"): words for name, words, _ in _made(place)}
    of_arm = ["--model", str(ROOT / "examples/arm/arm.toml")]
    beside = ["--importer", "xl330", "--reference", str(unchanged)]
    for name, data, words, needs in (
        ("wheeled", "navigation-plain", ["--trials", "4-7"], runs),
        ("light", "light-plain", ["--trials", "0-3"], runs),
        ("hexapod", "walk-plain", HEXAPOD, runs),
        ("arm", "cases-arm/cases/case_000000", of_arm, made),
        ("servo", changed, beside, {}),
        ("odometry", driven, ["--importer", "khepera3_odometry"], {}),
    ):
        out = ["--out", str(place / f"diagnosis-{name}")]
        plain = ["--no-report", "--no-rerun", "--threads", "1"]
        needed = {n: w for n, w in needs.items() if n == str(data).split("/")[0]}
        diagnose = ["gap", "diagnose", str(place / data), *words, *out, *plain]
        yield f"diagnosis {name}", diagnose, needed


def _reports(
    place: Path, runs: Mapping[str, list[str]]
) -> Iterator[tuple[str, list[str], dict[str, list[str]]]]:
    """Reports on one batch of each learner, and on two side by side."""
    for name, names in (
        ("navigation", ["navigation-plain"]),
        ("light", ["light-plain"]),
        ("walk", ["walk-plain"]),
        ("compared", ["navigation-plain", "navigation-window"]),
    ):
        words = ["report", *(str(place / run) for run in names)]
        out = place / f"report-{name}"
        out.mkdir(exist_ok=True)
        yield (
            f"report {name}",
            [*words, "--out", str(out / "report.html")],
            {run: runs[run] for run in names},
        )


def compared(found: Items, kept: Items) -> dict[str, list[str]]:
    """Print same or differs for each item; gives what differs in those that do."""
    differing = {}
    for name, files in found.items():
        parts = _parts(files), _parts(kept.get(name, {}))
        wrong = sorted(p for p in {*parts[0], *parts[1]} if _differs(p, *parts))
        if not files:
            wrong = ["(its command failed)"]
        elif name not in kept:
            wrong = ["(not kept)"]
        print(f"{'differs' if wrong else 'same':8}{name}")
        for part in wrong[:20]:
            print(f"          {part}")
        if wrong:
            differing[name] = wrong
    return differing


def _differs(part: str, one: Mapping[str, str], other: Mapping[str, str]) -> bool:
    return one.get(part) != other.get(part)


def _parts(files: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    return {
        f"{file}: {part}": value
        for file, parts in files.items()
        for part, value in parts.items()
    }


def environment() -> dict[str, str]:
    """What the bytes of a result may depend on, besides the package."""
    found = {"processor": _processor(), "python": platform.python_version()}
    return found | {name: version(name) for name in PACKAGES}


def key() -> str:
    """The environment in short."""
    return content.digest(json.dumps(environment(), sort_keys=True).encode())


def stored(path: Path) -> dict[str, dict]:
    """All that is kept, by environment."""
    return json.loads(path.read_text()) if path.exists() else {}


def record(path: Path, found: Items) -> None:
    """Keep items for this environment; its other items and environments stay."""
    kept = stored(path)
    mine = kept.setdefault(key(), {"environment": environment(), "items": {}})
    mine["items"] |= found
    path.write_text(_text(kept))


def _text(kept: Mapping[str, dict]) -> str:
    """JSON with a line a file, so that a change shows where it is."""
    lines = []
    for name, part in sorted(kept.items()):
        items = [
            f"  {json.dumps(item)}: {{\n    "
            + ",\n    ".join(
                f"{json.dumps(file)}: {json.dumps(hashes)}"
                for file, hashes in sorted(files.items())
            )
            + "\n  }"
            for item, files in sorted(part["items"].items())
        ]
        head = f'"environment": {json.dumps(part["environment"])}'
        inside = ",\n".join(items)
        lines.append(f'{json.dumps(name)}: {{{head},\n"items": {{\n{inside}\n}}}}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _last(common: str, own: Sequence[str]) -> list[str]:
    """Settings as words, those of `common` given last winning over those before."""
    groups: dict[str, list[str]] = {}
    words = [*own, *common.split()]
    for word in words:
        if word.startswith("--"):
            groups.pop(word, None)
            groups[word] = [word]
            last = word
        else:
            groups[last].append(word)
    return [word for group in groups.values() for word in group]


def _processor() -> str:
    """Maker, family, model and name: which instructions libraries choose."""
    wanted = ("vendor_id", "cpu family", "model", "model name")
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    pairs = [line.split(":", 1) for line in lines if ":" in line]
    facts = {name.strip(): value.strip() for name, value in reversed(pairs)}
    return " ".join(facts.get(name, "?") for name in wanted)


def _bns(words: Sequence[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bns", *words],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    if done.returncode != 0:
        said = (done.stdout + done.stderr)[-1000:]
        raise RuntimeError(f"bns {' '.join(words)} exited {done.returncode}: {said}")
