"""``python -m scan2nurbs``: the command line where scripts of packages are not on the PATH."""

from scan2nurbs.cli.main import main

if __name__ == "__main__":
    main()
