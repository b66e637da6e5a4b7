"""Factory against published calibration of a real Khepera III, from its motions."""

from bench.real_data import needed
from bench.result import Result

DOC = "Khepera III odometry: the found mount's distance from the published one"
BAR = "<= 3 sigma (published), axle or both diameters tied, plan a long straight drive"
BAR_VALUE = 3.0
TIED = {"axle", "both_diameters"}


def run(quick: bool) -> Result:
    """One diagnosis of 4396 intervals; quick changes nothing."""
    from bns.gap.importers import khepera3_odometry
    from bns.gap.models.odometry import diagnosis
    from bns.gap.models.odometry.fit import Motions

    home = needed("khepera3_odometry")
    trial = khepera3_odometry.read(home)
    published = khepera3_odometry.published(home)
    found = diagnosis.diagnose(Motions.of(trial, axle=khepera3_odometry.AXLE))
    verdict, supports = found.verdict, found.verdict.named
    best = found.fits[supports[0]] if supports else found.fits[()]
    mount = best.magnitudes.get("mount_x", 0.0)
    away = abs(mount - published.values["l_x"]) / published.deviations["l_x"]
    said = [TIED & set(support) for support in supports]
    tied = set().union(*said) == TIED and all(len(item) == 1 for item in said)
    planned = bool(found.plan) and found.plan[0][0].startswith("long straight")
    return Result(
        figure=round(float(away), 3),
        unit="published sigma",
        holds=bool(away <= BAR_VALUE and tied and planned),
        n=len(trial.commands),
        details={
            "verdict": verdict.sentence,
            "tied": tied,
            "plan": dict(found.plan),
            "supports": {
                " + ".join(s): dict(found.fits[s].magnitudes) for s in supports
            },
            "costs": {
                " + ".join(s) or "nothing": f.cost for s, f in found.fits.items()
            },
            "angle_deg": verdict.angle,
            "held_out_gain_and_its_error": found.gain,
            "deviation_m_m_rad": found.noise.deviation,
            "mount_x_mm": 1e3 * mount,
            "published_mount_x_mm": 1e3 * published.values["l_x"],
            "assumed_length_bias_mm": 1e3 * found.noise.length_bias,
        },
    )
