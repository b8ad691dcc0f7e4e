"""``python -m particell`` is the command line."""

from particell.cli import main

if __name__ == "__main__":
    main()
