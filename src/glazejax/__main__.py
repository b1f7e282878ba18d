"""`python -m glazejax`: the command."""

import sys

try:
    from .commands.main import run_command
except KeyboardInterrupt:
    sys.exit(130)

if __name__ == "__main__":
    run_command()
