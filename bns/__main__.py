"""`bns` and `python -m bns`."""

import os
import sys
import warnings
from collections.abc import Sequence

from bns.cli import dispatch
from bns.errors import BnsError, missing

WRONG_INPUT = 2
INTERRUPTED = 130
"""as shells report a program stopped by Ctrl-C"""
SPINS = "1000"
"""turns for which a thread of PyTorch waits for the others before it sleeps. By default
they are 300 times as many: where other programs run as well, those take the cores on
which the others would work. Two threads on two cores that two programs kept busy
needed 43 s for what took them more than 120; idle ones lose a tenth."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; what a user can cause gives one line and exit code 2."""
    os.environ.setdefault("GOMP_SPINCOUNT", SPINS)  # read when PyTorch is imported
    warnings.showwarning = _noted
    try:
        return dispatch(list(sys.argv[1:] if argv is None else argv))
    except BnsError as error:
        print(f"bns: {' '.join(str(error).split())}", file=sys.stderr)
        return WRONG_INPUT
    except ModuleNotFoundError as error:
        what = missing(error)
        if not what:
            raise
        print(f"bns: {what}", file=sys.stderr)
        return WRONG_INPUT
    except KeyboardInterrupt:
        print("bns: interrupted.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone (`bns ... | head`)
        sys.stderr.close()
        return 0


def _noted(message: Warning | str, *where: object, **more: object) -> None:
    """What a library warns of, such as a model's deprecated attribute: a line for who
    runs a command, without the place in our code."""
    del where, more
    print(f"note: {' '.join(str(message).split())}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
