"""`python -m layoutexplore` is the `layoutexplore` command."""

from layoutexplore.cli import main

if __name__ == "__main__":
    main()
