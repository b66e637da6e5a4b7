"""How long a diagnosis takes: of a wheeled robot and a walker. `gap-go2` times legs."""

from collections.abc import Sequence

from bench.gap.kept_cases import Stopwatch
from bench.result import Result, bench
from bns.gap.bench import cases
from bns.gap.diagnose import diagnose
from bns.gap.models.base import GapModel
from bns.worlds.trial import Trial

SEED = 3
WHEELED, WALKER = 10.0, 60.0  # [s] at most, on two quiet cores


@bench(
    "wall time of a diagnosis in a fresh process: a wheeled robot, the hexapod",
    bar="<= 10 s, <= 60 s",
)
def gap_time(quick: bool) -> Result:
    """One case each with an effect; quick: the wheeled one."""
    took = {"a wheeled robot": _wheeled()}
    if not quick:
        took["the hexapod"] = _walker()
    wheeled = took["a wheeled robot"]["seconds"]
    walker = took.get("the hexapod", {"seconds": 0.0})["seconds"]
    return Result(
        figure=wheeled,
        unit="s",
        holds=wheeled <= WHEELED and walker <= WALKER,
        n=len(took),
        details=took,
    )


def _wheeled() -> dict[str, float]:
    from bench.gap.strange_effects import other_solver
    from bns.gap.bench.wheeled_cases import WheeledStand
    from bns.gap.models.wheeled.model import WheeledModel

    stand = WheeledStand(WheeledModel(), other_solver())
    case = cases.build(SEED, "single", stand, wanted="wheel_gain[left]")
    return _timed(case.trials, WheeledModel())


def _walker() -> dict[str, float]:
    from bns.gap.bench.walk_cases import LARGE, WalkStand
    from bns.gap.models.legged.model import WalkModel

    case = cases.build(SEED, "large", WalkStand(WalkModel()), sizes=LARGE)
    return _timed(case.trials, WalkModel())


def _timed(trials: Sequence[Trial], model: GapModel) -> dict[str, float]:
    """Seconds of a diagnosis and of its processor time, to a hundredth."""
    watch = Stopwatch()
    diagnose(trials, model, seed=SEED)
    return {name: round(value, 2) for name, value in watch.read().items()}
