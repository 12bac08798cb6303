"""Entry point of the `eureka` command and `python -m openeureka`: Ctrl-C while modules load ends it without a word."""

import signal
from types import FrameType


def main() -> None:
    signal.signal(signal.SIGTERM, _terminated)
    try:
        from .cli.main import main

        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None  # `errors.Interrupted` may not be imported yet


def _terminated(number: int, frame: FrameType | None) -> None:
    """Do as Ctrl-C does, also in a shell's background process, which ignores Ctrl-C. A second SIGTERM kills at once."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    interrupted = signal.getsignal(signal.SIGINT)
    (interrupted if callable(interrupted) else signal.default_int_handler)(number, frame)


if __name__ == "__main__":
    main()
