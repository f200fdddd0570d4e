"""`python -m layoutexplore` is the `layoutexplore` command."""

from layoutexplore.processes import asked_to_stop, end_at_once, end_on_signals


def start() -> None:
    """Begin the command line; Ctrl-C and SIGTERM end it at any moment, while it is loaded too."""
    end_on_signals()
    try:
        from layoutexplore.cli import main as run

        run()
    finally:
        if asked_to_stop():
            end_at_once()


if __name__ == "__main__":
    start()
