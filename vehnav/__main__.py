"""``python -m vehnav`` is the command ``vehnav``."""

from vehnav.cli.main import main

if __name__ == "__main__":
    main()
