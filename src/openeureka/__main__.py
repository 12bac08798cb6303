"""Where the `eureka` command and `python -m openeureka` begin: Ctrl-C while the rest loads ends it without a word."""


def main() -> None:
    try:
        from .cli.main import main

        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None  # `errors.Interrupted` may be what is not loaded yet


if __name__ == "__main__":
    main()
