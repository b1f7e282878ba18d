"""`python -m glazejax.samples` prints where the films are, for a command line; `... recipes` where
the recipes are.
"""

import sys

from . import path


def main() -> None:
    """Print the path of the file that the command line names."""
    try:
        print(path(*sys.argv[1:2]))
    except ValueError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
