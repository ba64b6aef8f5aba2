"""``python -m reachmap`` is the ``reachmap`` command."""

from reachmap.cli import main

if __name__ == "__main__":
    main()
