"""How closely the Khepera III model drives like the laboratory's robot."""

from bench.result import Result, bench


@bench(
    "largest deviation of the Khepera's four calibration figures from the robot's",
    bar="<= 100 % of what is allowed (3 % speed and spin, 10 % starting losses)",
)
def khepera_calibration(quick: bool) -> Result:
    """Drive straight and spin from rest; quick changes nothing, it takes a second."""
    from bns import models
    from bns.models.khepera3 import calibration

    measured = calibration.measure(models.spec("khepera3"))
    shares = calibration.deviations(measured)
    worst = 100 * max(shares.values())
    return Result(
        figure=round(worst, 2),
        unit="% of what is allowed",
        holds=worst <= 100,
        n=len(shares),
        details={
            "measured": measured._asdict(),
            "target": {k: float(v) for k, v in calibration.TARGET._asdict().items()},
            "deviation_percent": {
                name: round(100 * share * getattr(calibration.TOLERANCE, name), 3)
                for name, share in shares.items()
            },
            "units": "speed m/s, spin rad/s, lost_distance m, lost_angle rad",
        },
    )
