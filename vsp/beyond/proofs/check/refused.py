"""What the checkers raise."""


class Refused(Exception):
    """The certificate does not prove its claim."""
