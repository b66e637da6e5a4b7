"""`bns doctor`: check this machine and say what to install."""

from dataclasses import dataclass

from bns.cli.parse import parse
from bns.cli.tables import show

BAD = 1
"""exit code when something must be changed"""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Check versions, known-bad pins, graphics, compiler, cores, disk and serial
    ports, and say what to install. Exit code 1 if something must be changed; what is
    only missing for one feature does not count.
    """

    json: bool = False
    """print JSON instead of a table"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    given = parse(Arguments, argv, prog="bns doctor")
    from bns.doctor import examine

    findings = examine()
    rows = [[f.state, f.what, f.found, f.remedy] for f in findings]
    show(["state", "what", "found", "what to do"], rows, json=given.json)
    bad = [f.what for f in findings if f.state == "bad"]
    if not given.json:
        print(f"To be changed: {', '.join(bad)}." if bad else "Ready to run.")
    return BAD if bad else 0
