"""The command line: ``sightray render | explain | scenes``."""

from __future__ import annotations


def main() -> None:
    """Entry point: run a command; errors that the user can mend are one line, and exit status 2."""
    import sys

    from sightray.cli.app import app
    from sightray.errors import SightrayError

    try:
        app()
    except SightrayError as error:
        print(f"sightray: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("sightray: interrupted", file=sys.stderr)
        sys.exit(130)
