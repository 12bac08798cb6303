"""`python -m openeureka` is the `eureka` command."""

from .cli.main import main

if __name__ == "__main__":
    main()
