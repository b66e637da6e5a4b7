"""Factory against published calibration of a real Khepera III, from its motions."""

from bench.real_data import needed
from bench.result import Result, bench

BAR_VALUE = 3.0
TIED = {"axle", "both_diameters"}
MOUNT = {"mount_x": "l_x", "mount_y": "l_y", "mount_angle": "l_theta"}


@bench(
    "Khepera III odometry: place and angle of the laser against the published ones",
    bar="<= 3 sigma (published), axle or both diameters tied, plan a long "
    "straight drive",
)
def gap_khepera_odometry(quick: bool) -> Result:
    """One diagnosis of 4396 intervals; quick changes nothing."""
    from bns.gap.importers import khepera3_odometry
    from bns.gap.models.odometry import diagnosis
    from bns.gap.models.odometry.motions import NUMBERS, Motions

    home = needed("khepera3_odometry")
    trial = khepera3_odometry.read(home)
    published = khepera3_odometry.published(home)
    found = diagnosis.diagnose(Motions.of(trial, axle=khepera3_odometry.AXLE))
    verdict, supports = found.verdict, found.verdict.named
    best = found.fits[supports[0]] if supports else found.fits[()]
    values = dict(zip(NUMBERS, best.values.tolist(), strict=True))
    away = {
        name: abs(values[name] - published.values[theirs])
        / published.deviations[theirs]
        for name, theirs in MOUNT.items()
    }
    said = [TIED & set(support) for support in supports]
    tied = set().union(*said) == TIED and all(len(item) == 1 for item in said)
    planned = bool(found.plan) and found.plan[0][0].startswith("long straight")
    return Result(
        figure=round(float(max(away.values())), 3),
        unit="published sigma",
        holds=bool(max(away.values()) <= BAR_VALUE and tied and planned),
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
            "published_sigmas": away,
            "changes": values,
            "published": published.values,
            "shares_alone_and_last_in": dict(found.shares),
            "inflation_of_variance": found.noise.inflation,
            "assumed_length_bias_mm": 1e3 * found.noise.length_bias,
        },
    )
