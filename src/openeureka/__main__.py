"""Where the `eureka` command and `python -m openeureka` begin: Ctrl-C while the rest loads ends it without a word."""

import signal
from types import FrameType


def main() -> None:
    signal.signal(signal.SIGTERM, _terminated)
    try:
        from .cli.main import main

        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None  # `errors.Interrupted` may be what is not loaded yet


def _terminated(number: int, frame: FrameType | None) -> None:
    """As Ctrl-C, also where a shell's background process ignores that. A second one does not wait."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    interrupted = signal.getsignal(signal.SIGINT)
    (interrupted if callable(interrupted) else signal.default_int_handler)(number, frame)


if __name__ == "__main__":
    main()
