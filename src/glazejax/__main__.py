"""`python -m glazejax`: the command."""

from .commands.main import main

if __name__ == "__main__":
    main()
