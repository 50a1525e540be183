"""The error that the checkers raise."""


class Refused(Exception):
    """The certificate does not prove its claim."""
