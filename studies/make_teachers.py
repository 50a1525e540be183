"""`make teachers`, `make short-teachers`: train the teachers, also those of robots, whose tasks are in `studies`."""

from vsp.run import command
from vsp.teachers.train import main

from . import robots  # noqa: F401  # registers the robots' tasks

if __name__ == "__main__":
    with command.in_one_line():
        main()
